"""What a whole run says, as data that the reports print and draw; nothing is run, and nothing is drawn, here.

A family is all settings of one method. All but `findings` takes the records of a run; `frame` returns these
as data frames of pandas, from which every export is made.
"""
