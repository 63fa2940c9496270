"""What the paper claims of the methods themselves."""

from functools import partial

from hbvm_bench.report.document import Claim, Maker
from hbvm_bench.studies.paper import properties_figures
from hbvm_bench.studies.paper.drawn import number
from hbvm_bench.studies.paper.experiments import properties
from hbvm_bench.studies.paper.results import Part, Results, Task
from hbvm_bench.summaries.table import Table
from integrators.gauss import Gauss
from integrators.hbvm import HBVM

PROBLEM = "The theory's statements, each measured on the paper's own polynomial problems."
PAIRS = tuple((k, s) for s in properties.DEGREES for k in (s, s + 1, 2 * s, 3 * s, properties.BIG))
REVERSED = (Gauss(s=2, h=0.5), HBVM(k=4, s=2, h=0.5), HBVM(k=9, s=4, h=0.5))
COLLOCATED = ((2, 2), (3, 2), (4, 2), (5, 2), (6, 2), (3, 3), (8, 3), (10, 4), (13, 5))
MAPPED = (
    Gauss(s=2, h=1.0),
    HBVM(k=4, s=2, h=1.0),
    HBVM(k=4, s=2, h=0.5),
    Gauss(s=3, h=1.0),
    HBVM(k=6, s=3, h=1.0),
)


def reversals() -> list[tuple[str, float]]:
    """Return how far runs there and back miss their start."""
    return [(repr(method), properties.reversal(method)) for method in REVERSED]


def extended() -> list[tuple[int, int, float]]:
    """Return (k, s, residual of the extended collocation conditions)."""
    return [(k, s, properties.extended_collocation(k, s)) for k, s in COLLOCATED]


def defects() -> list[tuple[str, float]]:
    """Return how far one step of each method is from symplectic."""
    return [(repr(method), properties.symplectic_defect(method)) for method in MAPPED]


def _blocks(results: Results) -> list[Maker]:
    return [
        ("the methods", lambda: PROBLEM),
        ("the order", lambda: properties_figures.order(results["orders"])),
        ("the threshold", lambda: properties_figures.threshold(results["cubic"], results["quintic"])),
        ("collocation and symplecticity", lambda: _collocation(results)),
    ]


def _collocation(results: Results) -> Table:
    what = "residual of σ′ = Σ Pⱼ ∫ Pⱼ f(σ) at the nodes"
    residuals = [
        (f"HBVM(k={k}, s={s}, h=0.5)", what, number(residual)) for k, s, residual in results["extended"]
    ]
    defects = [
        (method, "|MᵀJM − J|, M the derivative of one step", number(defect))
        for method, defect in results["symplectic"]
    ]
    return Table(
        key="claims-collocation",
        title="Extended collocation conditions, and what is not symplectic",
        head=("method", "what", "defect"),
        rows=[*residuals, *defects],
        words=(0, 1),
        note="The residual is on the quintic, where the integrals are exact from k ≥ 5s/2 on; "
        "the derivative on Hénon–Heiles. HBVM with k > s conserves the energy and is not "
        "symplectic; Gauss the other way about.",
    )


def _claims(results: Results) -> list[Claim]:
    orders: list[properties.Order] = results["orders"]
    off = max(abs(row.slope - 2 * row.s) for row in orders)
    back = max(error for _, error in results["reversal"])
    edge, inside = results["stability"]
    exact = {
        name: [row for row in results[name] if 2 * row[1] >= nu * row[0]]
        for name, nu in (("cubic", 3), ("quintic", 5))
    }
    below = [
        e
        for name, nu in (("cubic", 3), ("quintic", 5))
        for s, k, e in results[name]
        if 2 * k < nu * s and s <= 3
    ]
    kept = max(error for rows in exact.values() for _, _, error in rows)
    ranks_right = results["ranks"] == [s for _, s in PAIRS]
    turns = [count for _, count in results["iterations"]]
    residual = {(k, s): value for k, s, value in results["extended"]}
    met = max(value for (k, s), value in residual.items() if 2 * k >= 5 * s)
    unmet = min(value for (k, s), value in residual.items() if 2 * k < 5 * s)
    defect = dict(results["symplectic"])
    gauss = max(value for name, value in defect.items() if name.startswith("Gauss"))
    hbvm = min(value for name, value in defect.items() if name.startswith("HBVM"))
    return [
        Claim(
            "HBVM(k,s) has order 2s for all k ≥ s",
            "Section 2",
            f"fitted orders within {off:.2f} of 2s for s = 1 … 5 and k = s, s + 1, 2s, 3s",
            "holds" if off < 0.1 else "no",
        ),
        Claim(
            "It is symmetric",
            "Section 2",
            f"to t = 100 and back misses the start by {number(back)} at most",
            "holds" if back < 1e-12 else "no",
        ),
        Claim(
            "It is perfectly A-stable",
            "Section 2",
            f"| |R(iy)| − 1 | ≤ {number(edge)} for |y| ≤ 1e4, and |R| ≤ {inside:.12f} at 2000 points of the "
            f"left half plane, for {len(PAIRS)} pairs (k, s)",
            "holds" if edge < 1e-12 and inside < 1 else "no",
        ),
        Claim(
            "For k = s it is the Gauss method of order 2s",
            "Section 2",
            f"its tableau is that of collocation to {number(results['collocation'])}, s = 1 … 8"
            + ("; the same doubles come out" if results["same bits"] else ""),
            "holds" if results["same bits"] else "partly",
        ),
        Claim(
            "It conserves polynomial H of degree ν exactly when k ≥ νs/2",
            "Section 2",
            f"relative error ≤ {number(kept)} for all k ≥ νs/2 with ν = 3 and 5; for smaller k and s ≤ 3 it "
            f"is {number(min(below))} or more",
            "holds" if kept < 1e-13 else "no",
        ),
        Claim(
            "The system to solve has block size s, whatever k",
            "Section 2, remark",
            f"the stage matrix has rank s for all {len(PAIRS)} pairs"
            + ("" if ranks_right else " but some")
            + f"; from k = 2 to k = 36 the iterations per step go from {min(turns):.1f} to {max(turns):.1f}",
            "holds" if ranks_right else "no",
        ),
        Claim(
            "The extended collocation conditions hold at the nodes",
            "Section 2",
            f"residual ≤ {number(met)} for k ≥ νs/2, ≥ {number(unmet)} below",
            "holds" if met < 1e-13 else "no",
        ),
        Claim(
            "Gauss methods are symplectic (and HBVM with k > s is not, which the paper does not say)",
            "Section 1",
            f"|MᵀJM − J|: Gauss ≤ {number(gauss)}, HBVM ≥ {number(hbvm)}",
            "holds" if gauss < 1e-11 < hbvm else "no",
        ),
    ]


RUNS = [
    Task("orders", properties.orders, 4),
    Task("reversal", reversals),
    Task("stability", partial(properties.stability, PAIRS)),
    Task("collocation", properties.collocation_gap),
    Task("same bits", properties.same_bits),
    Task("cubic", properties.conservation_cubic),
    Task("quintic", properties.conservation_quintic),
    Task("ranks", partial(properties.ranks, PAIRS)),
    Task("iterations", properties.iterations),
    Task("extended", extended),
    Task("symplectic", defects),
]
PART = Part("claims", "What the paper says of the methods", RUNS, _claims, _blocks)
