"""The staircase and the fit."""

from __future__ import annotations

import math
import random
from pathlib import Path

import pytest

from hbot_experiments.psychometric import fit, plot, probability, sensation_noise
from hbot_experiments.staircase import LARGEST, START, Staircase


def run(weber: float, trials: int, numbers: random.Random) -> list[tuple[float, bool]]:
    staircase = Staircase()
    answers = []
    for _ in range(trials):
        difference = staircase.difference
        correct = numbers.random() < probability(difference, weber, lapse=0.0)
        staircase.record(correct)
        answers.append((difference, correct))
    return answers


def test_a_participant_is_right_in_three_of_four_trials_at_the_weber_fraction() -> None:
    assert probability(0.2, weber=0.2, lapse=0.0) == pytest.approx(0.75)
    assert probability(0.0, weber=0.2, lapse=0.0) == pytest.approx(0.5)


def test_two_sensations_with_this_noise_give_the_model() -> None:
    numbers = random.Random(3)
    noise = sensation_noise(0.2)
    trials = 20_000
    right = sum(
        math.log(1.1) + numbers.gauss(0, noise) > numbers.gauss(0, noise) for _ in range(trials)
    )
    expected = probability(0.1, weber=0.2, lapse=0.0)
    # Five standard deviations of a binomial fraction.
    assert right / trials == pytest.approx(expected, abs=5 * math.sqrt(0.25 / trials))


def test_the_staircase_halves_until_the_first_mistake_then_needs_three_in_a_row() -> None:
    staircase = Staircase()
    for _ in range(2):
        staircase.record(True)
    assert staircase.difference == START / 4
    staircase.record(False)
    assert staircase.difference == pytest.approx(START / 4 * 2**0.5)
    staircase.record(True)
    staircase.record(True)
    assert staircase.difference == pytest.approx(START / 4 * 2**0.5), "two are not enough"
    staircase.record(True)
    assert staircase.difference == pytest.approx(START / 4), "two reversals: a coarse step"
    staircase.record(False)
    assert staircase.difference == pytest.approx(START / 4 * 2**0.25), "the third: a fine step"
    for _ in range(40):
        staircase.record(False)
    assert staircase.difference == LARGEST


def test_the_staircase_stays_where_79_percent_are_correct() -> None:
    numbers = random.Random(5)
    answers = run(0.2, 20_000, numbers)[100:]
    correct = sum(right for _, right in answers) / len(answers)
    # 0.5 ** (1 / 3). Over a long run the fraction of correct answers must balance the steps: three
    # correct answers for one step down. With steps of equal size it deviates by less than 2 %.
    assert correct == pytest.approx(0.5 ** (1 / 3), abs=0.02)


@pytest.mark.parametrize("weber", [0.1, 0.2, 0.3])
def test_many_trials_give_the_weber_fraction(weber: float) -> None:
    found = fit(run(weber, 20_000, random.Random(7)))
    # A participant without lapses, fitted with 1 % of lapses, is estimated up to 7 % too low.
    assert found.weber == pytest.approx(weber, rel=0.07)
    assert found.low < found.weber < found.high


def test_the_interval_holds_the_truth_as_often_as_it_says() -> None:
    runs = 200
    fits = [fit(run(0.2, 80, random.Random(seed))) for seed in range(runs)]
    held = sum(each.low <= 0.2 <= each.high for each in fits) / runs
    # 95 % less four standard deviations of a binomial fraction.
    assert held >= 0.95 - 4 * math.sqrt(0.95 * 0.05 / runs)
    assert held < 1.0, "an interval that always holds it is too wide"


def test_an_interval_without_an_end_ends_with_the_search() -> None:
    assert fit([(0.8, False), (1.0, False)]).high == pytest.approx(5.0)
    with pytest.raises(ValueError, match="no trials"):
        fit([])


def test_a_plot_is_drawn(tmp_path: Path) -> None:
    answers = run(0.2, 80, random.Random(1))
    plot(answers, fit(answers), tmp_path / "p.svg")
    assert "Weber fraction" in (tmp_path / "p.svg").read_text()
