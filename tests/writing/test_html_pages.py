"""What all pages share: texts stay texts, and a verdict says at once what it is."""

from gantrytau.describing.pages import folded, page, table, verdict
from tests.writing.page_reader import Reader


def test_texts_are_escaped_and_tags_are_closed():
    rows = [["a < b", "1"], ["<script>", "&"]]
    parts = [
        verdict(False, "No & no", ["x < 1"]),
        folded("more", [table(["name", "value"], rows, "numbers", ["", 'id="here"']), ""], opened=True),
        "",
        table([], [["alone"]]),
    ]
    text = page("Pages <of> all", parts, "p { color: red; }")
    words = [x.text for x in Reader(text).root.find("title", "h2", "p", "summary", "th", "td")]
    assert words == [
        "Pages <of> all",
        "No & no",
        "x < 1",
        "more",
        "name",
        "value",
        "a < b",
        "1",
        "<script>",
        "&",
        "alone",
    ]
    assert '<tr id="here"><td>&lt;script&gt;</td>' in text
    assert '<div class="verdict bad">' in text
    assert 'class="verdict bad"' not in verdict(True, "Yes", [])
    assert "<details open>" in text
    assert text.index(".verdict") < text.index("p { color: red; }")  # rules of a page come last
