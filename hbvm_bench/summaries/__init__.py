"""What a whole run says, as data that the reports print and draw.

`points`     work against error, point by point, and the envelope of each family's best
`profiles`   Dolan-More performance profiles of the families over all problems
`needs`      which integrator for which need, in rows of text
`outcomes`   which integrator did what on which problem, with the reasons
`laws`       the law of each invariant's drift, in rows, and counted by family
`fairness`   how many settings each family had, and what is doubtful

Every function takes the records of a run (`hbvm_bench.store.store.Store.records`) and nothing
else: nothing is run, and nothing is drawn, here. A family is all settings of one method.
"""
