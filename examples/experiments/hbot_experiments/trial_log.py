"""The log of an experiment: one CSV line a trial, safe against a crash at any moment."""

from __future__ import annotations

import csv
import dataclasses
import fcntl
import io
import json
import os
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Generic, TypeVar

Row = TypeVar("Row")


class LogError(Exception):
    """A log cannot be continued. The message says why, and what to do."""


class TrialLog(Generic[Row]):
    """A CSV file of trials. A trial is on the disk when `append` returns.

    Beside `NAME.csv` stand `NAME.json` with the settings of the session, and
    `NAME.dictionary.csv` with the meaning and unit of each column. Both come from the program, so
    they are always those of the file.

    Opening an existing log continues it. A last line that a crash has cut is removed, because its
    trial will be run again. A log is locked while it is open, so two programs never write one log.
    """

    def __init__(self, path: Path, kind: type[Row], settings: Mapping[str, Any]) -> None:
        """Open or create a log.

        Args:
            path: the CSV file.
            kind: dataclass of a row, whose fields have the metadata `unit` and `meaning`. Fields
                are numbers or text.
            settings: what must be equal for the log to be continued, such as the seed.

        Raises:
            LogError: the log was made with other settings, is not a log of this experiment, or is
                open in another program.
        """
        self.path = path
        self._kind = kind
        self._columns = [field.name for field in dataclasses.fields(kind)]  # type: ignore[arg-type]
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)
        try:
            self._lock()
            self.rows: list[Row] = self._continue(settings)
        except BaseException:
            os.close(self._file)
            raise

    def __enter__(self) -> TrialLog[Row]:
        """Return the log itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the log."""
        os.close(self._file)

    def append(self, row: Row) -> None:
        """Add the row of a trial, in one write, and wait until it is on the disk."""
        self._write(dataclasses.astuple(row))  # type: ignore[call-overload]
        self.rows.append(row)

    def _lock(self) -> None:
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise LogError(f"{self.path}: another program is writing this log") from None

    def _continue(self, settings: Mapping[str, Any]) -> list[Row]:
        """Return the rows of an existing log. Begins a new one if there is none."""
        settings_path = self.path.with_suffix(".json")
        whole, cut = self._whole_lines()
        if not whole:
            os.ftruncate(self._file, 0)
            settings_path.write_text(json.dumps(dict(settings), indent=2) + "\n")
            self._write_dictionary()
            self._write(self._columns)
            return []
        if not settings_path.exists():
            raise LogError(f"{settings_path} is missing; choose another name for the log")
        before = json.loads(settings_path.read_text())
        for name, value in settings.items():
            if before.get(name) != value:
                raise LogError(
                    f"{self.path} was made with {name} = {before.get(name)!r}, not {value!r}; "
                    "choose another name for the log"
                )
        if cut:
            os.ftruncate(self._file, whole)
        with open(self.path, newline="") as file:
            lines = csv.DictReader(file)
            if lines.fieldnames != self._columns:
                raise LogError(f"{self.path} is not a log of this experiment: its columns differ")
            return [self._row(line) for line in lines]

    def _whole_lines(self) -> tuple[int, bool]:
        """Return the length of the complete lines in bytes, and whether more follows."""
        content = self.path.read_bytes()
        whole = content.rfind(b"\n") + 1
        return whole, whole < len(content)

    def _row(self, line: Mapping[str, str]) -> Row:
        kinds = {"int": int, "float": float, "str": str}
        fields = dataclasses.fields(self._kind)  # type: ignore[arg-type]
        return self._kind(**{f.name: kinds[str(f.type)](line[f.name]) for f in fields})

    def _write(self, cells: Any) -> None:
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerow(cells)
        line = text.getvalue().encode()
        if os.write(self._file, line) != len(line):
            raise LogError(f"{self.path}: the disk is full")
        os.fsync(self._file)

    def _write_dictionary(self) -> None:
        with open(self.path.with_suffix(".dictionary.csv"), "w", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(["column", "unit", "meaning"])
            for field in dataclasses.fields(self._kind):  # type: ignore[arg-type]
                writer.writerow([field.name, field.metadata["unit"], field.metadata["meaning"]])


def column(unit: str, meaning: str) -> Any:
    """Describe a column of a log. For fields of the dataclass of a row."""
    return dataclasses.field(metadata={"unit": unit, "meaning": meaning})
