"""The parts of the site that are generated: every public name, every message, every figure of the thesis, every page.

The whole site is built by `make docs`, which fails on a warning of Sphinx and on a broken link.
"""

import re
from collections import Counter

import pytest

from notebooks.site.builder.broken_links import broken_links
from notebooks.site.builder.generated.command_page import command_page
from notebooks.site.builder.generated.error_pages import by_task, error_pages
from notebooks.site.builder.generated.reference_pages import reference_pages, unplaced
from notebooks.site.builder.generated.thesis_page import thesis_pages
from notebooks.site.builder.places import ROOT, modules
from notebooks.site.builder.reading.docstrings import markdown, summary
from notebooks.site.builder.reading.error_catalogue import messages, split
from notebooks.site.builder.reading.public_names import public_names, public_packages
from notebooks.site.builder.reading.task_groups import listed_groups
from notebooks.site.builder.staging import Stage, handwritten, relinked, stage_handwritten
from tests.test_layers import house, too_large


@pytest.fixture(scope="module")
def reference() -> dict[str, str]:
    return dict(reference_pages())


def test_every_public_name_is_described_once(reference):
    text = "\n".join(reference.values())
    told = Counter(
        f"{package}.{name}"
        for package, name in re.findall(r"\{py:currentmodule\} (\S+)\n```\n\n:{7}\{py:\w+\} (\w+)", text)
    )
    expected = {one.full for one in public_names() if not one.same_as}
    assert set(told) == expected
    assert max(told.values()) == 1
    assert unplaced() == []


def test_packages_that_users_import_are_public():
    assert {"gantrytau", "gantrytau_models", "gantrytau_optimica", "gantrytau_fmu"} <= set(public_packages())
    assert {"gantrytau.mechanics.multibody", "gantrytau.mechanics.rotational", "gantrytau.blocks"} <= set(
        public_packages()
    )
    assert not [name for name in public_packages() if "commands" in name or "._" in name]


def test_what_two_packages_export_is_told_of_in_one_place():
    repeated = {one.full: one.same_as for one in public_names() if one.same_as}
    assert repeated["gantrytau_optimica.Samples"] == "gantrytau.Samples"
    assert repeated["gantrytau.blocks.StateSpace"] == "gantrytau.StateSpace"


def test_components_have_tables_with_units(reference):
    page = reference["reference/joints.md"]
    revolute = page[page.index("## Revolute") : page.index("## Cylindrical")]
    assert "| `tau` | N.m | driving torque about n |" in revolute
    assert "| `n[3]` | `[0.0, 0.0, 1.0]` | axis of rotation" in revolute
    assert "{py:obj}`Frame <gantrytau.mechanics.multibody.Frame>`" in revolute


def test_arguments_of_docstrings_become_lists():
    text = """Do it.

    start, stop: s; inputs: name -> number, see `Samples`. Raises ModelError for a_b * c_d.

        q = f(x)
    """
    told = markdown(
        text, ["start", "stop", "inputs"], lambda word: "gantrytau.Samples" if word == "Samples" else None
    )
    assert "- `start`, `stop`: s\n- `inputs`: name -\\> number, see {py:obj}`Samples" in told
    assert "a\\_b \\* c\\_d" in told
    assert "```python\nq = f(x)\n```" in told
    assert summary(text) == "Do it."


@pytest.mark.parametrize(
    ("text", "said", "remedy"),
    [
        ("a: found b; do c", "a: found b", "do c"),
        ("a (b; c): found d", "a (b; c): found d", ""),
        (
            "a: found 3, expected a number above 0",
            "a: found 3, expected a number above 0",
            "expected: a number above 0",
        ),
        ("a: it broke at t = 3. Start from another pose", "a: it broke at t = 3.", "Start from another pose"),
    ],
)
def test_remedies_are_told_from_what_is_said(text, said, remedy):
    assert split(text) == (said, remedy)


def test_known_messages_are_in_the_catalogue():
    text = "\n".join(page for _, page in error_pages())
    for words in (
        "Kinematics: found no orientation R, expected one, as this robot can turn its plate",
        "calibrate: constraints= with method=⟨asked⟩, expected method='ipopt', which alone keeps them",
        "exchange the two",
        "export or fetch the file again",
    ):
        assert words in text


def test_the_catalogue_holds_what_the_sources_raise():
    lines = {(m.module, m.line) for m in messages()}
    plain = []
    for name, path in modules().items():
        for number, line in enumerate(path.read_text().splitlines(), 1):
            raised = re.search(
                r"raise (Model|Solve|Structure|Vision|Calibration)Error\(f?\"([^\"]+)\"\)$", line
            )
            if raised and re.search(
                "[a-z]{3}", re.sub(r"\{.*?\}", "", raised[2])
            ):  # not one that is passed on
                plain.append((name, number))
    assert len(plain) > 100
    assert set(plain) <= lines
    assert sum(map(len, by_task().values())) == len(messages())


def test_pages_of_trees_are_there():
    pages = {
        *handwritten().values(),
        *dict(reference_pages()),
        "messages/index.md",
        *dict(thesis_pages({})),
        "command_line/index.md",
        "sources/index.md",
        "gallery/index.md",
        "library/index.md",
        "classics/index.md",
    }
    index = (ROOT / "notebooks/site/index.md").read_text()
    for body in re.findall(r"```\{toctree\}\n(.*?)```", index, re.DOTALL):
        for line in [line for line in body.splitlines() if line and not line.startswith(":")]:
            entry = line.partition("<")[2].rstrip(">") or line
            assert entry == "genindex" or f"{entry}.md" in pages, entry


def test_links_between_pages_of_folders_lead_to_pages_of_the_site(tmp_path):
    stage = Stage(tmp_path)
    for path, page in handwritten().items():
        if path.suffix == ".md":
            assert relinked(path.read_text(), path, page, stage)
    assert relinked(
        "[a](mechanics/README.md#loops)", ROOT / "gantrytau/README.md", "manual/gantrytau.md", stage
    ) == ("[a](mechanics.md#loops)")
    with pytest.raises(ValueError, match=r"found a link to nowhere\.md, expected a file that is there"):
        relinked("[a](nowhere.md)", ROOT / "README.md", "manual/overview.md", stage)


def test_every_page_of_a_folder_is_on_the_site():
    folders = ("gantrytau", "models", "optimica", "fmu", "notebooks", "tests")
    pages = [page for folder in folders for page in (ROOT / folder).rglob("*.md")]
    assert {*pages, *(ROOT / f"{page}.md" for page in ("README", "CONTRIBUTING", "CHANGELOG"))} == {
        path for path in handwritten() if path.suffix == ".md"
    }


def test_broken_links_are_found(tmp_path):
    (tmp_path / "a.html").write_text(
        '<a id="here" href="b.html#there">b</a><a href="c.html">c</a><img src="p.png"><a href="#here"></a>'
        '<a href="b.html#not">b</a><a href="https://example.org/x">x</a>'
    )
    (tmp_path / "b.html").write_text('<p id="there">')
    (tmp_path / "p.png").write_bytes(b"")
    assert sorted(broken_links(tmp_path)) == [
        "a.html: b.html#not: the page has no such place",
        "a.html: c.html: there is no such file",
        "a.html: p.png: an empty picture",
    ]


def test_the_command_line_is_told_with_its_options():
    page = command_page()
    simulate = page[page.index("## gantrytau simulate") :].partition("\n## ")[0]
    assert "| `--stop NUMBER` |  | Time at which to stop, in s. |" in simulate
    assert "`MODEL`" in simulate
    assert "`--set NAME=VALUE\\|FILE`" in simulate
    assert "## gantrytau fmu export" in page


def test_code_that_is_a_public_name_leads_to_the_reference(tmp_path):
    folder = tmp_path / "pages"
    stage = Stage(folder)
    stage_handwritten(stage)
    text = (folder / "manual/gantrytau.md").read_text()
    assert "{py:obj}`Dae <gantrytau.Dae>`" in text
    assert "{py:obj}`" not in "".join(re.findall("```python.*?```", text, re.DOTALL))
    stage.write("left.md", "x")
    again = Stage(folder)
    stage_handwritten(again)
    again.clear()
    assert not (folder / "left.md").exists()
    assert (folder / "manual/gantrytau.md").exists()


def test_the_search_passes_over_the_changelog_alone(tmp_path):
    stage_handwritten(Stage(tmp_path))
    hidden = [
        page for page in tmp_path.rglob("*.md") if page.read_text().startswith("---\nnosearch: true\n---\n")
    ]
    assert hidden == [tmp_path / "manual/changelog.md"]


def test_every_module_has_a_task():
    assert len({group.file for group in listed_groups()}) == len(listed_groups())


def test_files_of_the_builder_are_no_larger_than_others():
    folder = ROOT / "notebooks" / "site" / "builder"
    files = house({"builder": folder})
    assert len(files) > 10
    assert list(too_large(files)) == []
