"""References for the problems of a campaign that ask for one or give their end: kept beside the results."""

from collections.abc import Callable

import numpy as np

from hbvm_bench.campaign.file import Campaign, chosen
from hbvm_bench.campaign.identity import make_problem
from hbvm_bench.campaign.own import Known
from hbvm_bench.campaign.sweep import fill
from hbvm_bench.reference import solutions
from hbvm_bench.store.store import Store
from problems.errors import InputError, MissingLibraryError


def make_missing(campaign: Campaign, store: Store, known: Known, tell: Callable[[str], None]) -> Known:
    """Make the references that a campaign asks for and that are not known yet.

    Where the campaign gives the end, it is that. Else two computations share nothing but the formula,
    see `hbvm_bench.reference.trusted`; where they differ too early there is none, and the report says
    that no position was measured.

    They are kept in the store; ``tell`` is called with a sentence before and after each. Return what is
    known then.

    Raises
    ------
    problems.errors.MissingLibraryError
        Without heyoka.
    problems.errors.InputError
        For an end that is no state of its problem.
    """
    for entry in campaign.entries():
        for values in chosen(entry) if entry.reference or entry.end is not None else []:
            text = fill(entry.use, values)
            problem = make_problem(text, known)
            if entry.end is not None:
                given = solutions.of_end(problem, entry.end)
                if given != solutions.find_file(problem, known.references):
                    known |= Known(references={given.key: given})
                    store.keep(text, known)
                continue
            grid = entry.grid or campaign.grid
            samples = grid.times(problem, made=known.references)
            there = solutions.find(problem, known.references)
            if there is not None and there.t.size > 1 and np.isin(there.t, samples).all():
                continue
            from hbvm_bench.reference import trusted  # it brings numba, for the few campaigns that ask

            tell(f"computing a reference of {text} by two methods ...")
            try:
                file = trusted.make(problem, at=trusted.some(problem, samples))
            except MissingLibraryError:
                raise
            except InputError as error:
                tell(f"{text} has no reference: {error}")
                continue
            known |= Known(references={file.key: file})
            store.keep(text, known)
            tell(f"the two agree to {file.provenance['agreement']}")
    return known
