"""What a whole run says, as data that the reports print and draw; nothing is run, and nothing is drawn, here.

A family is all settings of one method. All but `findings` takes the records of a run.

There is no data frame. Records are nested (rounds of samples, reasons, growth by invariant): who wants a
flat table of them has to name and make each column anyway, as `export` does. A data frame would replace the
grouping (`rows.grouped_by` and its callers, 25 lines) and the writers of CSV and Parquet (35 lines), and cost
0.07 s (polars) or 0.34 s (pandas) of import beside NumPy's 0.15 s, and 180 or 84 MB on disk.
"""
