"""README, documentation and docstrings: what they say can be run, and is what the code has."""

import ast
import re

import pytest
from documented_commands import PAGES, ROOT

PARTLY_DOCUMENTED = {
    "quintic",
    "quintic_upsample",
    "quintic_positions",
    "intrinsic_torque",
    "reflex_torque",
    "closed_loop",
    "simulate",
    "average_correlations",
}
"""Compiled functions whose sections leave out arguments that the sentence above them explains."""
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
DOCUMENTED = (*FUNCTIONS, ast.ClassDef)
PLURAL_NOUNS = {"Settings", "Numbers", "Constants", "Values", "Columns", "Torques", "Recordings"}
"""First words that end like the verb of a class's sentence ("Holds", "Describes") and are none."""
PROPERTY_VERBS = {"Return", "Tell", "Say", "See"}
NO_QUANTITY = """
ACKNOWLEDGED AFTERWARDS APART ASKED BRIDGED BUSY CERTAIN CHANGED CLEAR COARSE COMMON DETECTABLE
DOUBTFUL ELSEWHERE ENOUGH EQUAL EVERYTHING EVERYWHERE FINE FIRST FORBIDDEN FOREIGN FOREVER FROZEN
FULL IGNORED INFINITE KEPT LARGEST LATE LATEST LEARNT LIKELIER LONG LONGEST MISSING NEAR NEEDED
NOTHING NOTICED PARTLY PLAUSIBLE QUICK REDUCED REQUIRED SAME SEEN SETTLED SHIPPED SHORT SHORTEST
SHOWN SILENT SMALL SMALLEST STARTING TOGETHER USEFUL USUAL
"""
"""Words that leave open what a constant holds: the largest what, late by how much?"""
NO_VERB = {
    "The",
    "A",
    "An",
    "One",
    "Whether",
    "What",
    "Which",
    "How",
    "Why",
    "When",
    "Where",
    "For",
}
VERBS_BEFORE_THAT = {"Check", "Make", "Note", "Publish", "Report", "Say", "Show", "State", "Tell"}
"""Verbs of a function's sentence that may stand before "that"; any other word there is a noun."""
MOST_WORDS = 36
"""Words of a sentence: a reader whose first language is another one still follows so many."""
COMMAND_WRITTEN = [p for p in PAGES if p.parent.name == "results" or p.name == "reliability.md"]
"""Pages whose tables a command writes: a cell may hold a message of the program."""


def documented(path):
    """Public functions and classes of a file that have a section of parameters.

    With the names of their arguments and of those documented.
    """
    tree = ast.parse(path.read_text())
    for owner in (tree, *(node for node in ast.walk(tree) if isinstance(node, ast.ClassDef))):
        for node in owner.body:
            if not isinstance(node, DOCUMENTED) or node.name.startswith("_"):
                continue
            text = ast.get_docstring(node) or ""
            section = re.search(r"^Parameters\n-+\n(.*?)(?=^\w[^\n]*\n-+\n|\Z)", text, re.M | re.S)
            made = [node] if not isinstance(node, ast.ClassDef) else node.body
            made = [one for one in made if getattr(one, "name", "") in (node.name, "__init__")]
            if section is None or not made:
                continue
            names = re.findall(r"^(\*{0,2}\w+(?:, \*{0,2}\w+)*)(?: :.*)?$", section[1], re.M)
            stated = {name.strip().lstrip("*") for line in names for name in line.split(",")}
            yield node.name, stated, arguments_of(made[0].args)


def arguments_of(signature):
    have = {a.arg for a in (*signature.posonlyargs, *signature.args, *signature.kwonlyargs)}
    have |= {a.arg for a in (signature.vararg, signature.kwarg) if a is not None}
    return have - {"self", "cls"}


def summaries(path):
    """Classes, properties and functions of a file with the first two words about each."""
    for node in ast.walk(ast.parse(path.read_text())):
        text = ast.get_docstring(node) if isinstance(node, DOCUMENTED) else None
        if text:
            yield node, (*text.split()[:2], "")


def has_verb(node, first, second):
    """Whether a docstring's summary begins with its verb: "Holds ..." for a class, "Return ..."."""
    if second == "of":
        return False
    if isinstance(node, ast.ClassDef):
        return re.fullmatch("[A-Z][a-z]+s", first) is not None and first not in PLURAL_NOUNS
    if second == "that" and first not in VERBS_BEFORE_THAT:
        return False
    if any("property" in ast.unparse(one) for one in node.decorator_list):
        return first in PROPERTY_VERBS
    return first not in NO_VERB and re.match("[A-Z][a-z]", first) is not None


PACKAGES = pytest.mark.parametrize(
    "package", sorted(path.parent.name for path in ROOT.glob("src/*/setup.py"))
)


@pytest.mark.parametrize(
    "folder",
    [
        "examples",
        *sorted(
            f"src/{path.parent.name}/{path.parent.name}" for path in ROOT.glob("src/*/setup.py")
        ),
    ],
)
def test_a_docstring_is_a_sentence_that_begins_with_its_verb(folder):
    """Whoever copies an example into a package has to find it in the package's style."""
    wrong = [
        f"{path.relative_to(ROOT)}:{node.lineno}: {node.name}: {first} {second} ..."
        for path in sorted((ROOT / folder).rglob("*.py"))
        for node, (first, second, *_) in summaries(path)
        if not has_verb(node, first, second)
    ]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("folder", ["src", "test", "benchmarks", "examples", "docs"])
def test_a_constant_is_named_by_what_it_holds(folder):
    wrong = [
        f"{path.relative_to(ROOT)}:{name.lineno}: {name.id}"
        for path in sorted((ROOT / folder).rglob("*.py"))
        for statement in ast.parse(path.read_text()).body
        if isinstance(statement, (ast.Assign, ast.AnnAssign))
        for name in ast.walk(statement)
        if isinstance(name, ast.Name) and isinstance(name.ctx, ast.Store)
        if name.id.lstrip("_") in NO_QUANTITY.split()
    ]
    assert not wrong, "\n".join(wrong)


@PACKAGES
def test_a_section_of_parameters_has_the_names_of_the_signature(package):
    wrong = [
        f"{path.relative_to(ROOT)}: {name}: {sorted(stated ^ have)}"
        for path in sorted((ROOT / "src" / package / package).rglob("*.py"))
        for name, stated, have in documented(path)
        if stated != have and not (stated < have and name in PARTLY_DOCUMENTED)
    ]
    assert not wrong, "\n".join(wrong)


def test_the_glossary_is_in_order_and_has_the_words_of_a_verdict():
    text = (ROOT / "docs" / "glossary.md").read_text()
    terms = re.findall(r"^(\w[^\n]*)\n  \w", text, re.M)
    assert len(terms) == len(set(terms)) > 80
    assert terms == sorted(terms, key=lambda term: term.lower().replace(".", " "))
    source = (ROOT / "src/model_discrepancy/model_discrepancy/report/html_report.py").read_text()
    shown = {"family", "rival", "ceiling", "BIC", "VAF", "residual", "tentative", "stated", "set"}
    verdicts = set(re.findall(r'verdict\.verdict == "(\w+)"', source)) | {"explained"}
    assert len(verdicts) == 4
    assert shown | {word.replace("_", " ") for word in verdicts} <= set(terms)


@pytest.mark.parametrize("page", PAGES, ids=str)
def test_links_between_pages_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text()):
        assert (page.parent / target).exists(), f"{page.name}: {target}"


def sentences(page):
    """The sentences of a page, without code blocks; a cell of a table is a text of its own.

    Tables that a command writes are left out.
    """
    text = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.M | re.S)
    text = re.sub(r"^ {4}.*$", "", text, flags=re.M)
    if page in COMMAND_WRITTEN:
        text = re.sub(r"^\|.*$", "", text, flags=re.M)
    text = re.sub(r"`[^`]+`|!?\[([^\]]*)\]\([^)]*\)", "code", text)
    text = re.sub(r"^ *(?=[-#] |\d+\. )", "\n\n", text, flags=re.M)
    texts = [" ".join(one.split()) for one in re.split(r"\n\s*\n|\|", text)]
    return [one for text in texts for one in re.split(r"[.:;?!][)*]*\s", text)]


@pytest.mark.parametrize("page", [*PAGES, ROOT / "CHANGELOG.md"], ids=str)
def test_a_sentence_of_the_documentation_is_short(page):
    long = [one for one in sentences(page) if len(one.split()) > MOST_WORDS]
    assert not long, "\n".join(long)
