"""Whole experiments with simulated participants on the real server."""

from __future__ import annotations

import csv
import math
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from serving import server


def command(experiment: str, address: str, folder: Path, *options: str) -> list[str]:
    module = f"hbot_experiments.{experiment}"
    where = ["--server", address, "--folder", str(folder), "--simulate"]
    return [sys.executable, "-m", module, "p1", *where, *options]


def rows(path: Path) -> list[dict[str, str]]:
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def test_a_run_that_is_killed_continues_without_a_lost_or_doubled_trial(tmp_path: Path) -> None:
    log = tmp_path / "p1-discrimination.csv"
    with server("--time", "virtual") as address:
        run = command("discrimination", address, tmp_path, "--trials", "12")
        with subprocess.Popen(run) as first:
            until = time.monotonic() + 60
            while not log.exists() or log.read_bytes().count(b"\n") < 5:
                assert first.poll() is None, "the program has ended"
                assert time.monotonic() < until, "no trials"
                time.sleep(0.01)
            first.send_signal(signal.SIGKILL)
        before = rows(log)
        second = subprocess.run(run, capture_output=True, text=True, check=True)
    after = rows(log)
    assert after[: len(before)] == before
    assert [int(row["trial"]) for row in after] == list(range(1, 13))
    assert "Weber fraction" in second.stdout
    assert log.with_suffix(".svg").exists()
    # The spring that was felt is the spring that was set.
    for row in after:
        standard_first = row["standard_first"] == "1"
        standard, comparison = ("felt_1", "felt_2") if standard_first else ("felt_2", "felt_1")
        assert float(row[standard]) == pytest.approx(1.0, rel=0.03)
        assert float(row[comparison]) == pytest.approx(1 + float(row["difference"]), rel=0.03)


def test_guidance_reduces_the_error_as_two_springs_in_parallel_do(tmp_path: Path) -> None:
    with server() as address:
        run = command("matching", address, tmp_path, "--trials", "8", "--perception", "0.1")
        subprocess.run(run, check=True)
    trials = rows(tmp_path / "p1-matching.csv")
    assert [int(row["trial"]) for row in trials] == list(range(1, 9))
    assert sum(float(row["guidance"]) > 0 for row in trials) == 4
    for row in trials:
        # The participant's eye errs by at most 0.45 rad here: sqrt(3) times 0.1 rad, times 2.6.
        assert 0.005 < float(row["error"]) < 0.45
    rms = {
        guided: math.sqrt(
            sum(float(r["error"]) ** 2 for r in trials if (float(r["guidance"]) > 0) == guided) / 4
        )
        for guided in (True, False)
    }
    assert rms[True] < rms[False]


def test_an_experiment_that_streams_refuses_virtual_time(tmp_path: Path) -> None:
    with server("--time", "virtual") as address:
        run = command("matching", address, tmp_path, "--trials", "1")
        done = subprocess.run(run, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr.startswith("error: the matching experiment needs a server in real time")
    assert "without `--time virtual`" in done.stderr
    assert not (tmp_path / "p1-matching.csv").exists()


@pytest.mark.parametrize(
    ("experiment", "last"),
    [
        ("matching", "The same command continues after the last complete trial."),
        ("discrimination", "The same command continues after the last complete trial."),
        ("recovery", None),
    ],
)
def test_a_missing_server_is_named_in_one_line(
    experiment: str, last: str | None, tmp_path: Path
) -> None:
    run = command(experiment, "127.0.0.1:1", tmp_path)
    if experiment == "recovery":  # It has neither a participant nor a log.
        run = [*run[:3], "--server", "127.0.0.1:1"]
    done = subprocess.run(run, capture_output=True, text=True)
    assert done.returncode == 1
    said = done.stderr.splitlines()
    assert said[0].startswith("error: no connection to 127.0.0.1:1: ")
    assert said[1:] == ([] if last is None else [last])


def test_one_experiment_follows_another_on_one_server(tmp_path: Path) -> None:
    with server() as address:
        for experiment in ("discrimination", "matching", "discrimination"):
            folder = tmp_path / "again" if (tmp_path / "p1-matching.csv").exists() else tmp_path
            run = command(experiment, address, folder, "--trials", "1")
            subprocess.run(run, check=True)


def test_the_recovery_without_a_hand_prints_a_row_for_each_participant() -> None:
    run = [sys.executable, "-m", "hbot_experiments.recovery", "--without-hand", "--runs", "2"]
    said = subprocess.run(run, capture_output=True, text=True, check=True).stdout.splitlines()
    assert len(said) == 5
    for weber, line in zip((0.1, 0.2, 0.3), said[2:], strict=True):
        true, mean, bias = (float(text) for text in line.split()[:3])
        assert true == weber
        # Two runs of 80 trials: a standard deviation of 25 % of the true value in each.
        assert 0.3 * weber < mean < 1.7 * weber
        assert mean - weber == pytest.approx(bias, abs=1.1e-3)  # The table has three digits.
