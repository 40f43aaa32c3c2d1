"""What a thing shows, is in or is like: captions, states of food, comparisons."""

import pytest
from autophyx_tet.predictors.text.reader import parse


@pytest.mark.parametrize(
    "line",
    [
        "head of a horse. Terracotta. Base: oak => head: terracotta; base: oak",
        "Cabeza de caballo. Mármol. Peana de nogal => cabeza: marble; peana: walnut",
        "the potato is boiled, the fork is tin => potato: boiled potato; fork: tin",
        "the carrot is raw, the fork is tin => carrot: carrot; fork: tin",
        "la patata está cocida, tenedor de plata => patata: boiled potato; tenedor: silver",
        "semelle cuir à tannage végétal, talon liège => semelle: veg tan leather; talon: cork",
    ],
)
def test_a_caption_or_a_state_names_the_matter(agree, line):
    agree(line)


@pytest.mark.parametrize(
    "name", ["gutta-percha", "acetal homopolymer", "polyvinyl butyral", "aluminium profile"]
)
def test_a_row_of_several_words_is_english(table, name):
    """The halves of its name are words of other languages too: "percha" is a hook."""
    assert not [note for note in parse(name, table).notes if "the text is read as" in note]


@pytest.mark.parametrize(
    "text",
    [
        "Dämpfer A ist Silikon, Dämpfer B auch Silikon, aber deutlich härter als Dämpfer A",
        "Le coussin A est en silicone, le coussin B est plus ferme que le coussin A",
        "El taco A es de silicona, el taco B también es de silicona, pero más firme que el taco A",
    ],
)
def test_a_comparison_has_adverbs_in_other_languages(table, text):
    noun = text.split()[text.startswith(("Le", "El"))]
    said = parse(text, table, [f"{noun} A", f"{noun} B"])
    assert any(clause.comparisons for clause in said.clauses)
