"""The psychometric function of a two-interval forced choice, its fit and its plot.

The model: each interval evokes a sensation, the logarithm of the stiffness plus normal noise
(Weber's law), and the participant chooses the interval with the greater sensation. Then the
probability of a correct answer is

    P(d) = lapse / 2 + (1 - lapse) Phi(z75 ln(1 + d) / ln(1 + w))

where `d` is the difference as a fraction of the standard, Phi the normal distribution function and
`z75` its 75 % quantile. The Weber fraction `w` is the difference at which 75 % of the answers are
correct if there are no lapses (Green and Swets, Signal Detection Theory and Psychophysics, 1966).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import NormalDist

from scipy.optimize import brentq, minimize_scalar

Answer = tuple[float, bool]
"""Difference of a trial as a fraction of the standard, and whether the answer was correct."""

Z75 = NormalDist().inv_cdf(0.75)
LAPSE = 0.01
"""Assumed fraction of trials in which a participant answers without having felt anything."""
SMALLEST, GREATEST = 1e-3, 5.0
"""Range in which the Weber fraction is searched."""
CONFIDENT = NormalDist().inv_cdf(0.975) ** 2
"""Twice the fall of the log likelihood at the ends of the 95 % interval: the 95 % quantile of the
chi-squared distribution with one degree of freedom."""
GRID = 120


@dataclass(frozen=True)
class Fit:
    """A fitted psychometric function."""

    weber: float
    """Weber fraction of greatest likelihood."""
    low: float
    """Lower end of the 95 % confidence interval of the Weber fraction."""
    high: float
    """Upper end of that interval."""
    trials: int
    """Number of trials."""


def sensation_noise(weber: float) -> float:
    """Return the standard deviation of one sensation, in units of the logarithm of stiffness."""
    return math.log1p(weber) / (Z75 * math.sqrt(2))


def probability(difference: float, weber: float, lapse: float = LAPSE) -> float:
    """Return the probability of a correct answer."""
    felt = NormalDist().cdf(Z75 * math.log1p(difference) / math.log1p(weber))
    return lapse / 2 + (1 - lapse) * felt


def fit(answers: Iterable[Answer]) -> Fit:
    """Fit the Weber fraction by maximum likelihood.

    The confidence interval holds the Weber fractions whose likelihood ratio is not significant at
    5 %. An interval that reaches the end of the search ends there.

    Raises:
        ValueError: there are no answers.
    """
    answers = list(answers)
    if not answers:
        raise ValueError("there are no trials to fit")
    counted = _count(answers)

    def misfit(logarithm: float) -> float:
        """Return twice the negative log likelihood of a Weber fraction."""
        total = 0.0
        for difference, (correct, wrong) in counted.items():
            p = probability(difference, math.exp(logarithm))
            total -= correct * math.log(p) + wrong * math.log1p(-p)
        return 2 * total

    first, last = math.log(SMALLEST), math.log(GREATEST)
    width = (last - first) / GRID
    # The likelihood can have a flat tail, so a grid finds the neighbourhood of its maximum.
    near = min((first + i * width for i in range(GRID + 1)), key=misfit)
    bounds = (max(near - width, first), min(near + width, last))
    best = float(minimize_scalar(misfit, bounds=bounds, method="bounded").x)
    limit = misfit(best) + CONFIDENT

    def end(outermost: float) -> float:
        if misfit(outermost) < limit:
            return outermost
        return float(brentq(lambda x: misfit(x) - limit, outermost, best))

    low, high = math.exp(end(first)), math.exp(end(last))
    return Fit(math.exp(best), low, high, len(answers))


def _count(answers: Sequence[Answer]) -> dict[float, tuple[int, int]]:
    """Return the numbers of correct and wrong answers by difference."""
    counted: dict[float, tuple[int, int]] = {}
    for difference, correct in answers:
        right, wrong = counted.get(difference, (0, 0))
        counted[difference] = (right + correct, wrong + (not correct))
    return counted


def plot(answers: Sequence[Answer], fitted: Fit, path: Path) -> None:
    """Draw the answers and the fitted function. The ending of `path` chooses the format."""
    import matplotlib

    matplotlib.use("agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(6, 4), layout="constrained")
    for difference, (right, wrong) in sorted(_count(answers).items()):
        axes.plot(difference, right / (right + wrong), "o", color="C0", ms=3 + (right + wrong) / 2)
    differences = [0.005 * 1.03**i for i in range(210)]
    for weber, style in ((fitted.low, ":"), (fitted.weber, "-"), (fitted.high, ":")):
        axes.plot(differences, [probability(d, weber) for d in differences], style, color="C1")
    axes.axvline(fitted.weber, color="grey", lw=0.8)
    axes.set(
        xscale="log",
        xlim=(0.01, 2.5),
        ylim=(0.0, 1.02),
        xlabel="difference of stiffness as a fraction of the standard",
        ylabel="fraction of correct answers",
        title=f"Weber fraction {fitted.weber:.3f}, 95 % interval {fitted.low:.3f} to "
        f"{fitted.high:.3f}, {fitted.trials} trials",
    )
    axes.title.set_fontsize(9)
    figure.savefig(path)
    pyplot.close(figure)
