"""What a batch leaves beside the results: one table as CSV and JSON, and one page to look at."""

from __future__ import annotations

import base64
import csv
import io
import json
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

from ...converters.files import writing
from ..io.document import SCHEMA, versions, write_json
from ..report.template import render
from .task import Job, Outcome

PICTURE_WIDTH, PICTURE_QUALITY = 480, 60  # pixels; about 8 kB a picture, 8 MB a thousand
COLUMNS: tuple[str, ...] = (
    "id", "asset", "text", "status", "code", "reason", "attempts", "seconds", "tets", "volume",
    "mass", "materials", "warnings", "folder",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class BatchResult:
    """The rows of a manifest and how each ended; ``new`` of them were run this time."""

    jobs: tuple[Job, ...]
    ended: Mapping[str, Outcome]
    new: int = 0
    rows: tuple[dict[str, Any], ...] = ()
    files: tuple[Path, ...] = ()

    def document(self) -> dict[str, Any]:
        """Return what ``batch --json`` prints, and results.json holds."""
        failed = [row for row in self.rows if row["code"]]
        return {
            "files": self.files,
            "assets": len(self.jobs),
            "done": len(self.rows) - len(failed),
            "failed": len(failed),
            "new": self.new,
            "codes": Counter(str(row["code"]) for row in self.rows),
            "rows": self.rows,
            "versions": versions(),
            "warnings": [f"{row['id']}: exit {row['code']}: {row['reason']}" for row in failed],
        }


def write_tables(output: Path, result: BatchResult) -> BatchResult:
    """Write results.csv, index.html and, last, results.json."""
    rows = tuple(_row(job, result.ended[job.id], output) for job in result.jobs)
    files = tuple(output / name for name in ("results.csv", "index.html", "results.json"))
    result = BatchResult(result.jobs, result.ended, result.new, rows, files)
    with writing(files[0]) as path, path.open("w", newline="", encoding="utf-8") as lines:
        table = csv.DictWriter(lines, COLUMNS)
        table.writeheader()
        table.writerows(rows)
    with writing(files[1]) as path:
        path.write_text(index_page(rows, output), encoding="utf-8", newline="\n")
    write_json(files[2], {"schema": SCHEMA, **result.document()})
    return result


def index_page(rows: tuple[dict[str, Any], ...], output: Path) -> str:
    """The page as text: a card for every row, failures first; it asks for nothing from outside."""
    failed = [row for row in rows if row["code"]]
    done = (row for row in rows if not row["code"])
    cards = [_card(row, output) for row in done]
    return render("index.html", count=len(rows), failures=failed, cards=cards)


def _row(job: Job, ended: Outcome, output: Path) -> dict[str, Any]:
    """One line of the table; what only a result knows stays empty for a failure."""
    row: dict[str, Any] = dict.fromkeys(COLUMNS, "") | {
        "id": job.id,
        "asset": job.asset,
        "text": job.text,
        "status": "failed" if ended.code else "done",
        "code": ended.code,
        "reason": ended.reason,
        "attempts": ended.attempts,
        "seconds": round(ended.seconds, 2),
    }
    if ended.code:
        return row
    run = json.loads((output / job.id / "run.json").read_text(encoding="utf-8"))
    return row | {
        **{name: run[name] for name in ("tets", "volume", "mass")},
        "materials": "; ".join(f"{part['name']}: {part['material']}" for part in run["parts"]),
        "warnings": len(run["warnings"]),
        "folder": job.id,
    }


def _card(row: Mapping[str, Any], output: Path) -> dict[str, str]:
    """Words of a result's card; its picture and its report by their addresses."""
    numbers = f"{row['tets']:,} tets, {row['mass']:.3g} kg, {row['seconds']:.0f} s"
    return {
        **{name: row[name] for name in ("id", "text", "materials")},
        "numbers": f"{numbers}, {row['warnings']} warnings",
        "report": f"{quote(row['folder'])}/report.html",
        "picture": _small(output / row["folder"] / "picture.png"),
    }


def _small(picture: Path) -> str:
    """A picture as a data address, small enough for a page of a thousand."""
    from PIL import Image

    with Image.open(picture) as image:
        image.thumbnail((PICTURE_WIDTH, PICTURE_WIDTH))
        data = io.BytesIO()
        image.convert("RGB").save(data, "WEBP", quality=PICTURE_QUALITY)
    return f"data:image/webp;base64,{base64.b64encode(data.getvalue()).decode()}"
