"""Reads a page strictly: every element closed in order, no identifier twice."""

from html.parser import HTMLParser

_VOID = {"br", "hr", "img", "meta", "link", "wbr", "col", "input"}


class Page(HTMLParser):
    def __init__(self):
        super().__init__(convert_charrefs=True)
        self.open, self.elements, self.ids, self.words = [], [], [], []

    def handle_starttag(self, element, attributes):
        self.elements.append((element, dict(attributes)))
        self.ids += [value for name, value in attributes if name == "id"]
        if element not in _VOID:
            self.open.append(element)

    def handle_endtag(self, element):
        assert self.open, f"</{element}> closes nothing"
        assert self.open.pop() == element, f"</{element}> in the wrong place"

    def handle_data(self, text):
        if self.open and self.open[-1] != "style":
            self.words.append(text)

    @property
    def text(self):
        return " ".join(" ".join(self.words).split())

    def all(self, element):
        return [attributes for name, attributes in self.elements if name == element]


def parsed(text: str) -> Page:
    page = Page()
    page.feed(text)
    page.close()
    assert not page.open, f"not closed: {page.open}"
    assert len(page.ids) == len(set(page.ids)), "an identifier occurs twice"
    return page
