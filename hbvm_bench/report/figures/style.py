"""One visual language: a method keeps its colour, dash and marker in every figure and table.

Colour and marker tell the family and survive the common kinds of colour blindness;
shade and dash tell the setting within it, and every case has a number, so that
nothing rests on colour alone.
"""

import colorsys
import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from hbvm_bench.campaign.spec import parse_spec
from hbvm_bench.store.records import Record
from hbvm_bench.summaries.points import by_family
from hbvm_bench.summaries.rows import grouped_by

# Of each method: its colour in the light and in the dark theme, and its marker.
METHODS = {
    "HBVM": ("#0a58b5", "#62b0ff", "o"),
    "Gauss": ("#0a8f9c", "#4fd3de", "D"),
    "LineIntegral": ("#7a4a1e", "#e0a46a", "d"),
    "Taylor": ("#c8500a", "#ff9a57", "s"),
    "IAS15": ("#17753a", "#5fcf86", "^"),
    "Leapfrog": ("#86720c", "#dcc44a", "v"),
    "WHFast": ("#8a2160", "#ec86bf", "P"),
    "WHFast512": ("#8a2160", "#ec86bf", "*"),
    "SABA": ("#8a2160", "#ec86bf", "D"),
    "MERCURIUS": ("#8a2160", "#ec86bf", "<"),
    "TRACE": ("#8a2160", "#ec86bf", ">"),
    "EOS": ("#86720c", "#dcc44a", "<"),
    "JANUS": ("#86720c", "#dcc44a", ">"),
    "BS": ("#17753a", "#5fcf86", "v"),
    "SemiImplicitEuler": ("#6b4bb8", "#b79cff", "X"),
    "LeapfrogMidpoint": ("#6b4bb8", "#b79cff", "<"),
    "ReversibleHeun": ("#6b4bb8", "#b79cff", ">"),
    "Dopri8": ("#6b4bb8", "#b79cff", "p"),
    "Tsit5": ("#6b4bb8", "#b79cff", "v"),
    "Kvaerno5": ("#6b4bb8", "#b79cff", "P"),
    "DOP853": ("#55606b", "#b4bfca", "h"),
    "Radau": ("#55606b", "#b4bfca", "H"),
    "BDF": ("#55606b", "#b4bfca", "d"),
    "LSODA": ("#55606b", "#b4bfca", "s"),
    "CVODE": ("#55606b", "#b4bfca", "v"),
    "Composition": ("#86720c", "#dcc44a", "P"),
    "Motion": ("#a8324a", "#ff8a9e", "8"),  # what is a property of the motion, not of a method
}
OTHERS = (("#a8324a", "#ff8a9e", "8"), ("#3d6b1f", "#a5d677", "8"), ("#7a4a1e", "#e0a46a", "8"))

DASHES: tuple[tuple[float, ...], ...] = (
    *((), (6, 2), (2, 1.6), (8, 2, 2, 2)),
    *((5, 1.5, 1.5, 1.5, 1.5, 1.5), (12, 3)),
)
IN_A_PANEL = 6  # cases

# Neutral colours of the figures; each is unique so that it can be themed in the page.
INK = "#1d2430"
MUTED = "#5c6674"
GRID = "#d9dee5"
TRUTH = "#9aa3ae"
PAPER = "#ffffff"
NEUTRALS = {INK: "--ink", MUTED: "--muted", GRID: "--line", TRUTH: "--truth", PAPER: "--paper"}
DARK_NEUTRALS = {
    "--ink": "#e8ecf2",
    "--muted": "#a2acba",
    "--line": "#2f3743",
    "--truth": "#6d7886",
    "--paper": "#14181f",
}


@dataclass(frozen=True)
class Look:
    """How one case looks."""

    number: int  # its number in the tables and figures, from 1 in the order of the campaign
    light: str  # its colour in the two themes
    dark: str
    dash: tuple[float, ...]  # on-off lengths in points; empty for a solid line
    marker: str  # of matplotlib


def looks(methods: Iterable[str]) -> dict[str, Look]:
    """Return the look of every method by its text or name, counted from 1; the same on every problem."""
    seen: dict[str, int] = {}
    taken: set[str] = set()
    by_method: dict[str, Look] = {}
    for number, method in enumerate(dict.fromkeys(methods), 1):
        light, dark, marker = base(parse_spec(method).name)
        # settings of one colour are told apart by shade and dash, whatever their method's name
        index = seen[light] = seen.get(light, -1) + 1
        light, dark = _unique(_shade(light, index, towards=0.0), taken), _shade(dark, index, towards=1.0)
        by_method[method] = Look(number, light, dark, DASHES[index % len(DASHES)], marker)
    return by_method


def base(name: str) -> tuple[str, str, str]:
    """Return the light and dark colour and the marker of a method; unknown names get steady ones."""
    return METHODS.get(name) or OTHERS[hashlib.sha256(name.encode()).digest()[0] % len(OTHERS)]


def options(record: Record) -> str:
    """Return the options of a case's method as short as a legend needs them."""
    words = []
    for name, value in parse_spec(record.case.method).arguments.items():
        if isinstance(value, bool):
            words.append(name if value else f"no {name}")
        else:
            words.append(value if isinstance(value, str) else f"{name}={value}")
    return ", ".join(words) or "default"


def panels(records: Sequence[Record]) -> list[tuple[str, list[Record]]]:
    """Divide cases into panels: by library, and by method where a library has more than `IN_A_PANEL`."""
    groups: list[tuple[str, list[Record]]] = []
    libraries = grouped_by(lambda record: "hbvm-bench" if record.role == "ours" else record.library, records)
    for library, members in libraries.items():
        names = by_family(members)
        if len(members) <= IN_A_PANEL:
            groups.append((f"{', '.join(names)} · {library}" if len(names) < 3 else library, members))
        else:
            groups += [(f"{name} · {library}", group) for name, group in names.items()]
    return groups


def _shade(colour: str, index: int, *, towards: float) -> str:
    # alternately deeper and paler, so that neighbours in a legend differ most
    if index == 0:
        return colour
    red, green, blue = (int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))
    hue, lightness, saturation = colorsys.rgb_to_hls(red, green, blue)
    step = 0.11 * ((index + 1) // 2)
    lightness += step if (index % 2 == 1) == (towards == 0.0) else -step * 0.8
    low, high = (0.16, 0.46) if towards == 0.0 else (0.6, 0.9)  # what stands out from the paper
    lightness = min(max(lightness, low), high)
    channels = colorsys.hls_to_rgb(hue, lightness, saturation)
    return "#" + "".join(f"{round(255 * channel):02x}" for channel in channels)


def _unique(colour: str, taken: set[str]) -> str:
    # a colour is replaced by a variable of the page, so two cases must not share one
    value = int(colour[1:], 16)
    while f"#{value:06x}" in taken or f"#{value:06x}" in NEUTRALS:
        value = (value + 1) % 2**24
    unique = f"#{value:06x}"
    taken.add(unique)
    return unique
