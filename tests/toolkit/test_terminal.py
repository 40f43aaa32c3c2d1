"""What a person reads: tables of every verb, each verdict with its way out, frames in one line."""

import tomllib
from pathlib import Path

from autophyx_tet.research import commands
from autophyx_tet.toolkit.cli import terminal
from autophyx_tet.toolkit.verdict import check
from autophyx_tet.toolkit.verdict.check import Check, with_doubts

ADVICE = tomllib.loads(Path(check.__file__).with_name("sentences.toml").read_text())["advice"]


def shown(capsys, document, lines):
    terminal.show(document, lines)
    return capsys.readouterr().out


def test_frames_are_told_in_one_line(capsys):
    frames = [f"out/motion_{i:05d}.vtu" for i in range(24)]
    files = ["out/mesh.msh", "out/motion.pvd", *frames, "out/run.json"]
    out = shown(capsys, {"files": files}, terminal.nothing)
    assert out.splitlines() == [
        "wrote out/mesh.msh",
        "wrote out/motion.pvd",
        "wrote out/motion_00000.vtu ... 24 frames",
        "wrote out/run.json",
    ]


def test_scores_are_a_table(capsys):
    """Every column of one value a row, a missing one left empty; nested ones are for --json."""
    row = {"predictor": "film", "mse_mean": 0.05651, "clause_accuracy": None, "by": {1: 0.2}}
    other = row | {"predictor": "table-mean", "clause_accuracy": 0.5}
    out = shown(capsys, {"rows": [row, other], "papers": {}}, commands._evaluation)
    heads, first, second = out.splitlines()
    assert heads.split() == ["predictor", "mse", "mean", "clause", "accuracy"]
    assert first.split() == ["film", "0.0565"]
    assert second.split() == ["table-mean", "0.0565", "0.5"]


def test_what_has_no_table_is_told(capsys):
    samples = [{"object": "chair", "clauses": ["oak legs", "soft seat"]}]
    sizes = {"clauses": 1200, "real_objects": 3}
    rows = (
        (commands._dataset, sizes, "1,200 clauses, 3 real objects"),
        (commands._samples, {"samples": samples}, "chair: oak legs"),
        (commands._training, {"steps": 2000, "history": []}, "trained for 2,000 steps"),
    )
    for lines, document, words in rows:
        assert words in shown(capsys, document, lines), document


def test_a_failed_check_says_what_to_do(capsys):
    """The sentence says what was found; then the way out, if it failed."""
    for name, advice in ADVICE.items():
        name = name.replace("_", " ")
        bad, good = (Check(name, outcome, "Found.") for outcome in ("failed", "passed"))
        body = {"tets": 9, "volume": 1.0, "mass": None, "modal": {"frequencies": ()}}
        body["modal"]["verdicts"] = [bad.document(), good.document()]
        out = shown(capsys, body, terminal.simulation).splitlines()[2:]
        sign = "!" if bad.mark == "warning" else "i"
        assert out == [f"{sign} Found. {advice}", "✓ Found."], name


def test_in_a_doubtful_unit_nothing_is_a_sure_good():
    """A chair of 900 m: that it holds is told, as of that size; its elements are right at any."""
    of_size = {"holds shape", "strength", "upright", "mass"}
    checks = [Check(name, "passed", f"{name}.") for name in (*of_size, "locking")]
    for right in (True, False):
        found = [*checks, Check("size", "passed" if right else "failed", "Long.")]
        sure = {one.name for one in with_doubts(found) if one.mark == "good"}
        assert sure == ({*of_size, "locking", "size"} if right else {"locking"})


def test_two_sentences_are_told_one_after_the_other(capsys):
    """Both have their numbers below their words; the files come once, at the end."""
    part = {"name": "leg", "material": "oak", "E": 1.0, "nu": 0.3, "rho": 1.0, "why": ""}
    modal = {"frequencies": (), "verdicts": ()}
    cases = [
        {"text": text, "tets": 9, "volume": 1.0, "mass": m, "verdicts": (), "modal": modal}
        | {"parts": [{**part, "mass": m}]}
        for text, m in (("oak", 2), ("tin", 7))
    ]
    out = shown(capsys, {**cases[0], "cases": cases, "files": ["report.html"]}, terminal.run)
    words = ["'oak'", "mass 2 kg", "'tin'", "mass 7 kg", "wrote report.html"]
    assert sorted(words, key=out.index) == words
    assert out.count(", mass") == 2


def test_voxels_by_words_are_a_table(capsys):
    parts = {"voxels": {"leaf": 1200, "trunk": 56}, "coherence": 0.7}
    seen = {"voxels": 1300, "seen": 900, "channels": 8, "encoder": "own"}
    out = shown(capsys, {"parts": parts, **seen}, terminal.features)
    assert [line.split() for line in out.splitlines()[:3]] == [
        ["word", "voxels"],
        ["leaf", "1,200"],
        ["trunk", "56"],
    ]
