"""Modelica and Optimica text: what is read, what is written, and what is said of faults."""

import random
import re
from pathlib import Path

import pytest

from gantrytau import translate
from gantrytau.border.refusal import ModelError
from gantrytau.modelica import SourceText, parse, read_tree, tree, written
from gantrytau_models import Pendulum

HERE = Path(__file__).parent
FILES = sorted(HERE.glob("constructs.mo*"))


def read(text, optimica=False):
    return parse(SourceText("robot.mo", text, optimica))


def faults(text, optimica=False):
    """Line, column and words of each fault."""
    with pytest.raises(ModelError) as caught:
        read(text, optimica)
    found = re.findall(r"^robot\.mo, line (\d+), column (\d+): (.*)$", str(caught.value), re.MULTILINE)
    return [(int(line), int(column), words) for line, column, words in found]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.suffix)
def test_what_is_written_reads_back_as_the_same_tree(path):
    first = read_tree(path)
    again = read(written(first), path.suffix == ".mop")
    assert again == first
    assert written(again) == written(first)


def test_a_tree_has_what_the_text_says():
    [package, _] = read_tree(HERE / "constructs.mo").classes
    assert (package.prefixes, package.kind, package.description) == (
        ("final", "encapsulated"),
        "package",
        "All constructs",
    )
    assert isinstance(package.body, tree.Composition)
    whole = next(
        one
        for one in package.body.sections[0].items
        if isinstance(one, tree.ClassDefinition) and one.name == "Whole"
    )
    assert isinstance(whole.body, tree.Composition)
    assert [section.kind for section in whole.body.sections] == [
        "", "public", "initial equation", "equation", "initial algorithm", "algorithm", "protected",
    ]  # fmt: skip
    assert whole.annotation is not None
    assert isinstance(whole.annotation[0], tree.Argument)
    assert whole.annotation[0].name == "experiment"


@pytest.mark.parametrize(
    ("short", "clear"),
    [
        ("a - b - c", "(a - b) - c"),
        ("-a * b ^ 2", "-(a * (b ^ 2))"),
        ("a / -b * c", "(a / (-b)) * c"),
        ("a + b * c ^ d", "a + (b * (c ^ d))"),
        ("not a and b or c", "((not a) and b) or c"),
        ("not a < b + 1", "not (a < (b + 1))"),
        ("a + 1:2 * n", "(a + 1):(2 * n)"),
        ("if a then b else c + 1", "if a then b else (c + 1)"),
        ("a .* b .+ c", "(a .* b) .+ c"),
    ],
)
def test_operators_bind_as_in_the_specification(short, clear):
    one, other = (read(f"model M equation x = {text}; end M;") for text in (short, clear))
    assert one == other


def test_a_sum_of_thousands_of_terms_is_no_deep_tree():
    terms = " + ".join(f"a[{i}] * b" for i in range(5000))
    assert terms in written(read(f"model M equation x = {terms}; end M;"))


def test_the_flat_text_of_a_translated_model_is_read():
    flat = read(translate(Pendulum()).equations("base-modelica"))
    text = written(flat)
    assert "'L'" not in text
    assert read(text) == flat


FAULTS = {  # a text with one fault: its line, its column, and what is said
    "model M\n  Real x\n  Real y;\nend M;": (2, 9, "found 'Real' in line 3, expected ';'"),
    "model M\n  Real x y;\n  Real z;\nend M;": (2, 10, "found 'y', expected ';'"),
    "model M\nequation\n  x = ;\n  y = 1;\nend M;": (3, 7, "found ';', expected an expression"),
    "model M\nequation\n  x := 1;\nend M;": (3, 5, "found ':=', expected '=', as ':=' is for algorithms"),
    "model M\nalgorithm\n  x = 1;\nend M;": (3, 5, "found '=', expected ':=', as '=' is for equations"),
    "model M\nequation\n  if a the\n  x = 1;\n  else\n  x = 2;\n  end if;\nend M;": (3, 8, "found 'the', expected 'then'"),
    "model M\nequation\n  if a then\n  x = 1;\nend M;": (5, 1, "found 'end M', expected 'end if'"),
    "model M\nequation\n  if a then\n  x = 1;\n  end;\n  y = 1;\nend M;": (5, 3, "found 'end', expected 'end if'"),
    "model M\n  Real x;\n  x = 1;\n  connect(a, b);\nend M;": (
        3, 3, "found an equation or a statement, expected 'equation' before it",
    ),
    "model M\nequation\n  for i in 1:2 loop\n  x = 1;\n  end if;\nend M;": (5, 3, "found 'end if', expected 'end for'"),
    "model M\n  Real x;\nend N;": (3, 1, "found 'end N', expected 'end M'"),
    "model M\n  Real x;\nend model;": (3, 1, "found 'end model', expected 'end M'"),
    "package P\nmodel M\n  Real x;\nend P;": (4, 1, "found 'end P', expected 'end M'"),
    "package P\nmodel M\n  Real x;\n": (3, 10, "found the end of the file, expected 'end M'"),
    "model M\n  Real x(start = 1;\n  Real y;\nend M;": (2, 19, "found ';', expected ',' or ')'"),
    "model M\n  Real x = [1, 2; 3 4; 5, 6];\n  Real y;\nend M;": (2, 21, "found 4, expected ']'"),
    "model M\n  Real flow;\nend M;": (2, 8, "found the keyword 'flow', expected a name"),
    "model 3\n  Real x;\nend M;": (1, 7, "found 3, expected a name"),
    "model M\n  Real x\n    start = 1,\n    min = 0);\n  Real y;\nend M;": (2, 9, "found 'start' in line 3, expected ';'"),
    "model M\n  Real x \"a;\n  Real y \"b\";\nend M;": (
        3, 11, "found 'b', expected ';'; the string before it begins in line 2: is a quote missing?",
    ),
    "model M\n  Real x; /* never\nend M;": (2, 11, "found a comment that no '*/' closes"),
    "model M\n  Real x = 3 # 4;\nend M;": (2, 14, "found '#', expected ';'"),
    "model M\nequation\n  x = a < b < c;\nend M;": (3, 13, "found '<', expected ';'"),
    "model M\nequation\n  x = f(a = 1, 2);\nend M;": (3, 16, "found 2, expected a name"),
    "model M\nequation\n  else\n  x = 1;\nend M;": (3, 3, "found 'else', to which no block belongs"),
    "model M\n  outer Real x\nequation\n  x = 1;\nend M;": (2, 15, "found the keyword 'equation' in line 3, expected ';'"),
    "optimization O(objective = 1)\nend O;": (
        1, 1, "found 'optimization', expected 'within' or a class; 'optimization' is Optimica, which stands in .mop files",
    ),
    "print('hello')\n": (1, 1, "found 'print', expected 'within' or a class"),
    "// nothing\n": (1, 11, "found no class, expected 'within' or a class"),
    f"model M\nequation\n  x = {'(' * 2000}1{')' * 2000};\nend M;": (3, ..., "brackets or blocks that lie too deep"),
}  # fmt: skip


@pytest.mark.parametrize("text", FAULTS, ids=[fault[2] for fault in FAULTS.values()])
def test_a_fault_has_one_message_with_its_place(text):
    line, column, words = FAULTS[text]
    [(found_line, found_column, found)] = faults(text)
    assert (found_line, column if column is ... else found_column) == (line, column)
    assert words in found


def test_every_fault_of_a_file_is_told():
    text = "model M\n  Real x y;\n  Real z[2;\nequation\n  x = 1 + ;\n  for i loop\n    z[i] == 1;\n  end for;\nend M;"
    assert [line for line, _, _ in faults(text)] == [2, 3, 5, 7]
    many = "model M\n" + "  Real x y;\n" * 30 + "end M;"
    with pytest.raises(ModelError, match=r"robot\.mo: and 10 more"):
        read(many)


def test_the_line_is_shown_with_a_caret():
    with pytest.raises(ModelError) as caught:
        read("model M\n\tReal x y;\nend M;")
    assert str(caught.value).splitlines()[1:] == ["    \tReal x y;", "    \t       ^"]


def test_constraints_of_optimica_are_no_equations():
    assert (
        "expected '=', '<=' or '>='"
        in faults("optimization O\nconstraint\n  x < 1;\nend O;", optimica=True)[0][2]
    )


def test_files_are_in_utf_8(tmp_path):
    path = tmp_path / "Umlaut.mo"
    text = 'model M "für"\nend M;'
    path.write_text(text, encoding="utf-8-sig")
    assert read_tree(path).classes[0].description == "für"
    path.write_text(text, encoding="latin-1")
    with pytest.raises(
        ModelError, match=r"line 1, column 11: found the byte 0xfc, expected UTF-8.*iconv -f latin1"
    ):
        read_tree(path)
    with pytest.raises(ModelError, match="cannot be read: No such file"):
        read_tree(tmp_path / "none.mo")


def damaged(text, chance):
    """The text with a piece left out, doubled, moved elsewhere, or replaced by signs."""
    a, b = sorted(chance.sample(range(len(text)), 2))
    b = min(b, a + chance.choice((1, 1, 3, 10, 200)))
    there = chance.randrange(len(text))
    piece = text[a:b]
    return chance.choice(
        (
            text[:a] + text[b:],
            text[:a] + piece + piece + text[b:],
            text[:there] + piece + text[there:],
            text[:a]
            + chance.choice(("(", ")", ";", "end", "[", '"', "if", "equation", "\0", "*/", "ä", "="))
            + text[b:],
            text[:a],
        )
    )


def test_damaged_files_have_a_message_and_never_a_crash():
    chance = random.Random(37)
    texts = {path.suffix == ".mop": path.read_text(encoding="utf-8") for path in FILES}
    refused = 0
    while refused < 500:
        optimica = chance.random() < 0.5
        text = damaged(texts[optimica], chance)
        message = ""
        try:
            found = read(text, optimica)
        except ModelError as error:
            message = str(error).replace("\t", " ")
        else:  # damage within names, strings and comments is no fault
            assert found.classes
            assert read(written(found), optimica) == found
            continue
        assert re.match(r"robot\.mo, line \d+, column \d+: found .*\n.*\n *\^", message)
        refused += 1
