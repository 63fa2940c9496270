"""References for the problems of a campaign that ask for one or give their end: kept beside the results."""

from collections.abc import Callable

import numpy as np

from hbvm_bench.campaign.file import Campaign, chosen
from hbvm_bench.campaign.identity import make_problem
from hbvm_bench.campaign.sweep import fill
from hbvm_bench.reference import solutions
from hbvm_bench.store.store import Store
from problems.errors import InputError, MissingLibraryError


def make_missing(campaign: Campaign, store: Store, tell: Callable[[str], None]) -> bool:
    """Make the references that a campaign asks for and that are not known yet.

    Where the campaign gives the end, it is that. Else two computations share nothing but the formula,
    see `hbvm_bench.reference.trusted`; where they differ too early there is none, and the report says
    that no position was measured.

    They are kept in the store; ``tell`` is called with a sentence before and after each. Return whether
    there are new ones.

    Raises
    ------
    problems.errors.MissingLibraryError
        Without heyoka.
    problems.errors.InputError
        For an end that is no state of its problem.
    """
    any_made = False
    for entry in campaign.entries():
        for values in chosen(entry) if entry.reference or entry.end is not None else []:
            text = fill(entry.use, values)
            problem = make_problem(text)
            if entry.end is not None:
                given = solutions.of_end(problem, entry.end)
                if given != solutions.find_file(problem):
                    solutions.add_known(solutions.encode(given))
                    store.keep(text)
                    any_made = True
                continue
            samples = (campaign.grid if entry.grid is None else entry.grid).times(problem)
            known = solutions.find(problem)
            if known is not None and known.t.size > 1 and np.isin(known.t, samples).all():
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
            solutions.add_known(solutions.encode(file))
            store.keep(text)
            tell(f"the two agree to {file.provenance['agreement']}")
            any_made = True
    return any_made
