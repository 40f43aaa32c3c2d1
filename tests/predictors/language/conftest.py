"""What a sentence says of parts, as the tests of the reader ask for it."""

import pytest
from autophyx_tet.fem.table import load_table
from autophyx_tet.predictors.text.clauses import bind
from autophyx_tet.predictors.text.reader import parse


@pytest.fixture(scope="session")
def table():
    return load_table()


@pytest.fixture(scope="session")
def clauses_of(table):
    """Text, part names -> for each part the clauses that speak of it, the most specific first."""

    def of(text, names):
        sentence = parse(text, table, names)
        bound = bind(sentence, [[name] for name in names])
        return {
            name: [bound.sentence.clauses[k] for k in part.clauses]
            for name, part in zip(names, bound.parts, strict=True)
        }

    return of


@pytest.fixture(scope="session")
def agree(clauses_of, table):
    """Assert that lines such as "the legs are oak => leg_1, leg_2: oak; seat: -" are read so."""

    def check(lines):
        wrong = []
        for line in filter(None, map(str.strip, lines.splitlines())):
            text, _, said = line.rpartition(" => ")
            wanted = {}
            for group in said.split("; "):
                names, _, row = group.rpartition(": ")
                meant = None if row == "-" else table.exact(row).name
                wanted.update(dict.fromkeys(names.split(", "), meant))
            found = clauses_of(text.replace("\\n", "\n"), list(wanted))
            read = {
                name: next((clause.material for clause in said if clause.material), None)
                for name, said in found.items()
            }
            wrong += [] if read == wanted else [(text, read)]
        assert not wrong

    return check
