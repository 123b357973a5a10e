"""The log survives a crash at any byte, and refuses what does not belong to it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest

from hbot_experiments.trial_log import LogError, TrialLog, column

SETTINGS = {"participant": "p", "seed": 1}


@dataclass(frozen=True)
class Row:
    trial: int = column("", "number")
    felt: float = column("N m/rad", "stiffness, with a comma")


ROWS = [Row(1, 0.1), Row(2, float("inf")), Row(3, 1 / 3)]


def write(path: Path) -> bytes:
    with TrialLog(path, Row, SETTINGS) as log:
        for row in ROWS:
            log.append(row)
    return path.read_bytes()


def test_a_log_that_was_cut_at_any_byte_is_continued_without_a_lost_or_doubled_trial(
    tmp_path: Path,
) -> None:
    path = tmp_path / "log.csv"
    whole = write(path)
    for length in range(len(whole) + 1):
        path.write_bytes(whole[:length])
        with TrialLog(path, Row, SETTINGS) as log:
            complete = max(whole[:length].count(b"\n") - 1, 0)
            assert log.rows == ROWS[:complete]
            for row in ROWS[complete:]:
                log.append(row)
        assert path.read_bytes() == whole


def test_the_columns_are_explained(tmp_path: Path) -> None:
    write(tmp_path / "log.csv")
    dictionary = (tmp_path / "log.dictionary.csv").read_text().splitlines()
    assert dictionary[2] == 'felt,N m/rad,"stiffness, with a comma"'


def test_other_settings_are_refused(tmp_path: Path) -> None:
    write(tmp_path / "log.csv")
    with pytest.raises(LogError, match="seed = 1, not 2"):
        TrialLog(tmp_path / "log.csv", Row, {"participant": "p", "seed": 2})


def test_another_file_is_refused(tmp_path: Path) -> None:
    write(tmp_path / "log.csv")
    (tmp_path / "log.csv").write_text("a,b\n1,2\n")
    with pytest.raises(LogError, match="columns differ"):
        TrialLog(tmp_path / "log.csv", Row, SETTINGS)


def test_two_programs_never_write_one_log(tmp_path: Path) -> None:
    with (
        TrialLog(tmp_path / "log.csv", Row, SETTINGS),
        pytest.raises(LogError, match="another program"),
    ):
        TrialLog(tmp_path / "log.csv", Row, SETTINGS)
