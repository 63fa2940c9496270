"""One visual language: a family keeps its colour and marker in every figure and table.

Lines carry their names, so that nothing rests on colour alone.
"""

import colorsys
import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache

from matplotlib.colors import to_hex, to_rgb

from hbvm_bench.summaries.points import PROJECTION

# Of each family: its colour in the light and in the dark theme, and its marker.
METHODS = {
    "HBVM": ("#0a58b5", "#62b0ff", "o"),
    PROJECTION: ("#0a58b5", "#62b0ff", "h"),
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
    """How a family looks."""

    number: int  # from 1, for the styles of a page
    light: str  # its colour in the two themes
    dark: str
    marker: str  # of matplotlib


def looks(families: Iterable[str]) -> dict[str, Look]:
    """Return the look of every family, which is the same on every page, counted from 1."""
    return {family: Look(number, *look(family)) for number, family in enumerate(dict.fromkeys(families), 1)}


@cache
def look(family: str) -> tuple[str, str, str]:
    """Return the light and dark colour and the marker of a family; unknown names get steady ones.

    Families of one library share a hue and differ in its shade.
    """
    if family not in METHODS:
        return OTHERS[hashlib.sha256(family.encode()).digest()[0] % len(OTHERS)]
    light, dark, marker = METHODS[family]
    index = [name for name, (colour, *_) in METHODS.items() if colour == light].index(family)
    return shade(light, index, low=0.16, high=0.46), shade(dark, -index, low=0.6, high=0.9), marker


def shade(colour: str, index: int, *, low: float = 0.16, high: float = 0.46) -> str:
    """Return the shade of a colour with this number, within bounds of its lightness: 0 is the colour itself.

    They are alternately paler and deeper, so that neighbours differ most.
    """
    if index == 0:
        return colour
    hue, lightness, saturation = colorsys.rgb_to_hls(*to_rgb(colour))
    step = 0.11 * ((abs(index) + 1) // 2)
    lightness += step if (index % 2 == 1) == (index > 0) else -step * 0.8
    return to_hex(colorsys.hls_to_rgb(hue, min(max(lightness, low), high), saturation))
