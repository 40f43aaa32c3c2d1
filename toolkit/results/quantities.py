"""Numbers as a reader wants them: with an SI prefix, in the unit of their size, rounded."""

from __future__ import annotations

import numpy as np

_PREFIXES = {9: "G", 6: "M", 3: "k", 0: "", -3: "m", -6: "µ", -9: "n"}


def si(value: float, unit: str, *, digits: int = 3) -> str:
    """Value with an SI prefix: ``si(1.2e9, "Pa") gives 1.20 GPa``."""
    power, prefix = _prefix(value)
    return f"{rounded(value / 10**power, digits)}\u00a0{prefix}{unit}"


def si_span(lo: float, hi: float, unit: str) -> str:
    """Two values with their prefixes, or one where they are close."""
    return si(lo, unit) if np.isclose(lo, hi) else f"{si(lo, unit)} – {si(hi, unit)}"


def mass_words(value: float) -> str:
    """Mass [kg] in the unit a scale would show."""
    if 0 < value < 1:
        return si(value * 1e3, "g")
    return f"{rounded(value, 3)}\u00a0kg" if value < 1e4 else f"{rounded(value / 1e3, 3)}\u00a0t"


def area_words(value: float) -> str:
    """Area [m^2] in mm², cm² or m²: a prefix before a square would be squared with it."""
    for size, unit, most in ((1e6, "mm²", 1e-4), (1e4, "cm²", 1.0)):
        if value < most:
            return f"{rounded(value * size, 3)}\u00a0{unit}"
    return f"{rounded(value, 3)}\u00a0m²"


def volume_words(value: float) -> str:
    """Volume [m^3] in mm³, cm³ or m³."""
    for size, unit in ((1e-6, "mm³"), (1e-1, "cm³")):
        if value < size:
            return f"{rounded(value * (1e9 if unit == 'mm³' else 1e6), 3)}\u00a0{unit}"
    return f"{rounded(value, 3)}\u00a0m³"


def rounded(value: float, digits: int) -> str:
    """Value to so many digits; a dash where it is not finite."""
    if not np.isfinite(value):
        return "–"
    if value != 0 and not 1e-3 <= abs(value) < 1e6:
        return f"{value:.{digits - 1}e}"
    # 9.9999999999 is ten: it has one decimal less
    decimals = digits - 1 - int(np.floor(np.log10(abs(value) * (1 + 1e-9)))) if value else 0
    return f"{value:,.{max(0, min(decimals, 6))}f}"


def value_words(value: object) -> str:
    """Any value of a document in words: yes and no, numbers to four digits, lists with commas."""
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, int | np.integer):
        return f"{value:,}"
    if isinstance(value, float | np.floating):
        return rounded(float(value), 4)
    if isinstance(value, list | tuple):
        return ", ".join(map(value_words, value))
    return "–" if value is None else str(value)


def _prefix(value: float) -> tuple[int, str]:
    if value == 0 or not np.isfinite(value):
        return 0, ""
    power = int(np.clip(3 * np.floor(np.log10(abs(value) * (1 + 1e-9)) / 3), -9, 9))
    return power, _PREFIXES[power]
