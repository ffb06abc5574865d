"""What all pages share: texts stay texts, and a verdict says at once what it is."""

from html.parser import HTMLParser

from gantrytau.describing.pages import folded, page, table, verdict


class Tags(HTMLParser):
    """Checks that tags close in the order in which they open, and collects the text."""

    def __init__(self, text):
        super().__init__()
        self.open, self.words = [], []
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag, attrs):
        if tag != "meta":
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if data.strip() and self.open[-1] != "style":
            self.words.append(data)


def test_texts_are_escaped_and_tags_are_closed():
    rows = [["a < b", "1"], ["<script>", "&"]]
    parts = [
        verdict(False, "No & no", ["x < 1"]),
        folded("more", [table(["name", "value"], rows, "numbers", ["", 'id="here"']), ""], opened=True),
        "",
        table([], [["alone"]]),
    ]
    text = page("Pages <of> all", parts, "p { color: red; }")
    words = [
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
    assert Tags(text).words == words
    assert '<tr id="here"><td>&lt;script&gt;</td>' in text
    assert '<div class="verdict bad">' in text
    assert 'class="verdict bad"' not in verdict(True, "Yes", [])
    assert "<details open>" in text
    assert text.index(".verdict") < text.index("p { color: red; }")  # rules of a page come last
