"""What a whole run says, as data that the reports print and draw.

`points`     cases by problem and by family, their numbers, and which of them nothing else beats
`profiles`   Dolan-More performance profiles of the families over all problems
`needs`      which integrator for which need, in rows of text
`outcomes`   which integrator did what on which problem, with the reasons
`laws`       the law of each invariant's drift, in a few signs, and counted by family
`fairness`   how many settings each family had, and what is doubtful

`findings`   what can be read off a formula or a problem; it takes no records

Every other function takes the records of a run (`hbvm_bench.store.store.Store.records`) and nothing
else: nothing is run, and nothing is drawn, here. A family is all settings of one method.
"""
