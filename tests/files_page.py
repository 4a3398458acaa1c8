"""docs/files.md read as a table of what files hold, and a file held against it."""
import os
import re

import h5py

from calls import SOURCE


def names_in(text):
    return re.findall(r"`(\w[\w/-]*)`", text)


class FilesPage:
    """`datasets[kind]`: {name: the sets of dimensions that its rows give}; `attributes[kind]`: those of files of that kind."""

    def __init__(self):
        with open(os.path.join(SOURCE, "docs", "files.md"), encoding="utf-8") as file:
            parts = re.split(r"^## ", file.read(), flags=re.MULTILINE)[1:]
        sections = {title: text for title, _, text in (part.partition("\n") for part in parts)}
        self.datasets = {title: self.rows(text) for title, text in sections.items()}
        listed = {title: self.named_attributes(text) for title, text in sections.items()}
        every, but_laws = listed.pop("How do I read one?")
        common = {title: set(every) | (set() if title == "laws" else set(but_laws)) for title in sections}
        self.own_attributes = {title: set().union(*map(set, listed.get(title, ()))) for title in sections}
        for title, text in sections.items():
            if "coefficients of a run's file" in " ".join(text.split()):
                self.own_attributes[title] |= {"A", "B", "K0", "K1", "s_delta", "v", "steady_eta", "steady_stable"}
        self.attributes = {title: common[title] | self.own_attributes[title] for title in sections}

    @staticmethod
    def named_attributes(text):
        """Of each sentence that begins with `Attributes`, the names; what stands in brackets says what they are."""
        paragraphs = re.findall(r"^Attributes.*?(?=\n\n|\Z)", text, re.MULTILINE | re.DOTALL)
        sentences = [sentence for paragraph in paragraphs
                     for sentence in re.findall(r"Attributes.*?(?=\. Attributes|\Z)", paragraph, re.DOTALL)]
        plain = [re.sub(r"\(.*?\)(?!\])|which says.*?`|of all but.*?:", "", sentence, flags=re.DOTALL) for sentence in sentences]
        return [[name for name in names_in(sentence) if name != "sweep_key"] for sentence in plain]

    @staticmethod
    def rows(section):
        found = {}
        cell = r"((?:\\\||[^|])*)"
        for first, second, last in re.findall(rf"^\| {cell} \| {cell} (?:\| [\w/^*() -]* ?)?\| {cell} \|$", section, re.MULTILINE):
            dimensions = [tuple(each.split(", ")) for each in second.split("; ")]
            names = names_in(first)
            for number, name in enumerate(names):
                if name.endswith("/"):
                    for each in names_in(re.sub(r"(?:with|of) `\w+`", "", last)):  # options
                        found.setdefault(name + each, set()).add(dimensions[0])
                else:
                    found.setdefault(name, set()).add(dimensions[number if len(dimensions) == len(names) else 0])
        return found


def within(some, dimensions):
    """Are these of the dimensions, in their order?"""
    rest = iter(dimensions)
    return all(name in rest for name in some)


def contents(path):
    """(the kind of a file, its attributes, {dataset: its dimensions})."""
    found = {}

    def look(name, item):
        if isinstance(item, h5py.Dataset):
            own = item.attrs.get("CLASS") == b"DIMENSION_SCALE"
            scales = [name] if own else [scale[0].name.lstrip("/") if len(scale) else "?" for scale in item.dims]
            found[name] = tuple(scale.rpartition("/")[2] for scale in scales)
            assert len(found[name]) == item.ndim, name

    with h5py.File(path) as file:
        file.visititems(look)
        return file.attrs["kind"], set(file.attrs), found


def disagreements(path, page, but=()):
    """What a file holds otherwise than the page says: names, dimensions, attributes."""
    kind, attributes, found = contents(path)
    wrong = [f"attribute {name}" for name in attributes - page.attributes[kind]]
    for name, dimensions in found.items():
        rows = page.datasets[kind].get(name)
        if name not in but and (rows is None or not any(within(dimensions, row) for row in rows)):
            wrong.append(f"{name} over {dimensions}, by the page {rows}")
    return wrong
