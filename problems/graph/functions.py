"""The elementary functions of a formula: all that is known of each, in one record.

What a traced function calls as ``m.name``, what is differentiated, evaluated with more
digits, emitted and printed reads this table. A further function is one more record.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from problems import double_double
from problems.double_double import DD

ONE = Fraction(1)
SLOW = 3  # operations that take as long to compile as a sine
_TWO_OVER_SQRT_PI = Fraction(2 / math.sqrt(math.pi))
_INFINITY = math.inf
WHOLE = 1.5 * 2.0**52
"""Added to a double and subtracted again, it leaves the nearest whole number."""


@dataclass(frozen=True)
class Slope:
    """A derivative ``factor * times / over``; ``None`` is 1.

    The factor is exact, and the division is left to the differentiation, which joins it with others.
    """

    times: Any = None
    over: Any = None
    factor: Fraction = ONE


@dataclass(frozen=True, kw_only=True)
class Elementary:
    """An elementary function.

    Attributes
    ----------
    name : str
        What a formula calls it.
    value : callable
        The value at doubles; `ValueError` or `OverflowError` where it has none.
    derivative : callable or None
        From nodes of a graph: the `Slope`, or one for each of several arguments; ``None`` if it is 0, or if
        the chain rule is not what differentiates it.
    double_double : callable
        The value at numbers of twice the digits.
    arity : int
        Number of arguments.
    domain : tuple of float
        Least and largest argument at which the value is a finite double.
    of_value : bool
        Whether ``derivative`` is given the node of the function itself, and not its arguments:
        exp' = exp.
    numpy, numba, jax : str
        Name in the library, or text with ``{}`` for the arguments; by default the same name. Those of
        numba are from `math`, or else from NumPy; those of NumPy and JAX without a dot from `scipy.special`.
    mpmath : str
        Name in mpmath; of what it does not have, ``value`` is taken, with the digits of doubles.
    heyoka : str or None
        As for NumPy; ``None`` for what heyoka does not have: it is refused.
    latex : str
        Text with ``%s`` for the arguments.
    cost : int
        Additions that take as long to compile.
    smooth : bool
        Whether the derivatives are continuous inside the domain.
    """

    name: str
    value: Callable[..., float]
    derivative: Callable[..., Slope | tuple[Slope, ...]] | None
    double_double: Callable[..., DD]
    arity: int = 1
    domain: tuple[float, float] = (-_INFINITY, _INFINITY)
    of_value: bool = False
    numpy: str = ""
    numba: str = ""
    jax: str = ""
    mpmath: str = ""
    heyoka: str | None = ""
    latex: str = ""
    cost: int = SLOW
    smooth: bool = True

    def __post_init__(self) -> None:
        names = {"numpy": f"np.{self.name}", "numba": self.name, "jax": f"jnp.{self.name}"}
        names |= {"mpmath": self.name, "heyoka": f"hy.{self.name}", "latex": rf"\{self.name}\left(%s\right)"}
        for field, text in names.items():
            if getattr(self, field) == "":
                object.__setattr__(self, field, text)

    def slopes(self, node: Any) -> tuple[Slope, ...]:
        """Return the derivatives with respect to each argument of a node of this function."""
        if self.derivative is None:
            return (Slope(factor=Fraction(0)),) * self.arity
        result = self.derivative(node) if self.of_value else self.derivative(*node.args)
        return result if isinstance(result, tuple) else (result,)


def _applied(name: str, x: Any) -> Any:
    return x.graph.call(name, x)


def _by_one_minus_square(x: Any, factor: Fraction) -> Slope:
    return Slope(over=_applied("sqrt", (1.0 - x) * (1.0 + x)), factor=factor)


def _of_angle(y: Any, x: Any) -> tuple[Slope, Slope]:
    square = y * y + x * x
    return Slope(x, square), Slope(y, square, -ONE)


_RECORDS = (
    Elementary(
        name="sqrt",
        value=math.sqrt,
        domain=(0.0, _INFINITY),
        derivative=lambda f: Slope(over=f, factor=Fraction(1, 2)),
        of_value=True,
        double_double=double_double.sqrt,
        latex=r"\sqrt{%s}",
        cost=1,
    ),
    Elementary(
        name="sin",
        value=math.sin,
        derivative=lambda x: Slope(_applied("cos", x)),
        double_double=double_double.sin,
    ),
    Elementary(
        name="cos",
        value=math.cos,
        derivative=lambda x: Slope(_applied("sin", x), factor=-ONE),
        double_double=double_double.cos,
    ),
    Elementary(
        name="tan",
        value=math.tan,
        derivative=lambda f: Slope(f.graph.node(1.0) + f * f),
        of_value=True,
        double_double=double_double.tan,
    ),
    Elementary(
        name="exp",
        value=math.exp,
        domain=(-_INFINITY, 709.782712893384),
        derivative=lambda f: Slope(f),
        of_value=True,
        double_double=double_double.exp,
        latex="e^{%s}",
    ),
    Elementary(
        name="expm1",
        value=math.expm1,
        domain=(-_INFINITY, 709.782712893384),
        derivative=lambda x: Slope(_applied("exp", x)),
        double_double=double_double.expm1,
        latex=r"\left(e^{%s} - 1\right)",
    ),
    Elementary(
        name="log1p",
        value=math.log1p,
        domain=(-0.9999999999999999, _INFINITY),
        derivative=lambda x: Slope(over=1.0 + x),
        double_double=double_double.log1p,
        jax="(2.0*jnp.arcsinh(({0})/(2.0*jnp.sqrt(1.0 + ({0})))))",  # its own is right to 3e-14 only
        latex=r"\ln\left(1 + %s\right)",
    ),
    Elementary(
        name="log",
        value=math.log,
        domain=(5e-324, _INFINITY),
        derivative=lambda x: Slope(over=x),
        double_double=double_double.log,
        latex=r"\ln\left(%s\right)",
    ),
    Elementary(
        name="abs",
        value=math.fabs,
        derivative=lambda x: Slope(_applied("sign", x)),
        double_double=double_double.absolute,
        numba="fabs",
        mpmath="fabs",
        heyoka="(hy.relu({0}) + hy.relu(-({0})))",
        latex=r"\left|%s\right|",
        cost=1,
        smooth=False,
    ),
    Elementary(
        name="sign",
        value=lambda x: float(x > 0.0) - float(x < 0.0),
        derivative=None,
        double_double=double_double.sign,
        heyoka="(hy.relup({0}) - hy.relup(-({0})))",
        latex=r"\operatorname{sign}\left(%s\right)",
        cost=1,
        smooth=False,
    ),
    Elementary(
        name="round",
        value=lambda x: math.copysign(round(x), x),
        derivative=None,
        double_double=double_double.rint,
        numpy="np.rint",
        # The sum has no digits behind the point. Of numbers beyond 2^51 the result may be off by one.
        numba=f"(({{}} + {WHOLE}) - {WHOLE})",
        jax="jnp.rint",
        mpmath="nint",
        heyoka=None,
        latex=r"\operatorname{round}\left(%s\right)",
        cost=1,
        smooth=False,
    ),
    Elementary(
        name="floor",
        value=lambda x: float(math.floor(x)),
        derivative=None,
        double_double=double_double.floor,
        heyoka=None,
        latex=r"\left\lfloor %s \right\rfloor",
        cost=1,
        smooth=False,
    ),
    Elementary(
        name="sinh",
        value=math.sinh,
        domain=(-710.4758600739439, 710.4758600739439),
        derivative=lambda x: Slope(_applied("cosh", x)),
        double_double=double_double.sinh,
    ),
    Elementary(
        name="cosh",
        value=math.cosh,
        domain=(-710.4758600739439, 710.4758600739439),
        derivative=lambda x: Slope(_applied("sinh", x)),
        double_double=double_double.cosh,
    ),
    Elementary(
        name="tanh",
        value=math.tanh,
        derivative=lambda f: Slope(f.graph.node(1.0) - f * f),
        of_value=True,
        double_double=double_double.tanh,
    ),
    Elementary(
        name="asin",
        value=math.asin,
        domain=(-1.0, 1.0),
        derivative=lambda x: _by_one_minus_square(x, ONE),
        double_double=double_double.asin,
        latex=r"\arcsin\left(%s\right)",
    ),
    Elementary(
        name="acos",
        value=math.acos,
        domain=(-1.0, 1.0),
        derivative=lambda x: _by_one_minus_square(x, -ONE),
        double_double=double_double.acos,
        latex=r"\arccos\left(%s\right)",
    ),
    Elementary(
        name="atan",
        value=math.atan,
        derivative=lambda x: Slope(over=1.0 + x * x),
        double_double=double_double.atan,
        latex=r"\arctan\left(%s\right)",
    ),
    Elementary(
        name="asinh",
        value=math.asinh,
        derivative=lambda x: Slope(over=_applied("sqrt", 1.0 + x * x)),
        double_double=double_double.asinh,
        latex=r"\operatorname{arsinh}\left(%s\right)",
    ),
    Elementary(
        name="acosh",
        value=math.acosh,
        domain=(1.0, _INFINITY),
        derivative=lambda x: Slope(over=_applied("sqrt", (x - 1.0) * (x + 1.0))),
        double_double=double_double.acosh,
        latex=r"\operatorname{arcosh}\left(%s\right)",
    ),
    Elementary(
        name="atanh",
        value=math.atanh,
        domain=(-0.9999999999999999, 0.9999999999999999),
        derivative=lambda x: Slope(over=(1.0 - x) * (1.0 + x)),
        double_double=double_double.atanh,
        jax="jnp.arcsinh(({0})/jnp.sqrt((1.0 - ({0}))*(1.0 + ({0}))))",  # as for log1p
        latex=r"\operatorname{artanh}\left(%s\right)",
    ),
    Elementary(
        name="erf",
        value=math.erf,
        derivative=lambda x: Slope(_applied("exp", -(x * x)), factor=_TWO_OVER_SQRT_PI),
        double_double=double_double.erf,
        numpy="erf",
        jax="erf",
        latex=r"\operatorname{erf}\left(%s\right)",
    ),
    Elementary(
        name="erfc",
        value=math.erfc,
        derivative=lambda x: Slope(_applied("exp", -(x * x)), factor=-_TWO_OVER_SQRT_PI),
        double_double=double_double.erfc,
        numpy="erfc",
        jax="erfc",
        latex=r"\operatorname{erfc}\left(%s\right)",
    ),
    Elementary(
        name="atan2",
        arity=2,
        value=math.atan2,
        derivative=_of_angle,
        double_double=double_double.atan2,
        numpy="np.atan2({}, {})",
        numba="atan2({}, {})",
        jax="jnp.atan2({}, {})",
        heyoka="hy.atan2({}, {})",
        latex=r"\operatorname{atan2}\left(%s, %s\right)",
    ),
)

FUNCTIONS: dict[str, Elementary] = {record.name: record for record in _RECORDS}
"""All of them, by name."""

_CHOICE = Elementary(
    name="where",
    arity=3,
    value=lambda condition, a, b: a if condition > 0 else b,
    derivative=None,
    double_double=lambda condition, a, b: double_double.where(condition.rounded() > 0.0, a, b),
    numpy="np.where({} > 0.0, {}, {})",
    numba="where({}, {}, {})",
    jax="jnp.where({} > 0.0, {}, {})",
    heyoka="hy.select(hy.gt({}, 0.0), {}, {})",
    latex=r"\operatorname{where}\left(%s, %s, %s\right)",
    cost=1,
    smooth=False,
)
CALLED: dict[str, Elementary] = FUNCTIONS | {_CHOICE.name: _CHOICE}
"""What is evaluated and printed as a call: these, and the choice of one of two numbers."""

OF_ONE_ARGUMENT = tuple(f.name for f in _RECORDS if f.arity == 1)
"""Those of one argument."""
