"""What the wheel and the source archive hold."""

import email.message
import email.parser
import tarfile
import zipfile
from pathlib import Path

from eval.wheel.place import ROOT, Check, Place, expect

_SOURCES = (
    *("fbid_gym", "assets", "train", "eval", "tests", "docs", "studies", "hyperparams", "examples"),
    *("Makefile", "pyproject.toml", "constraints.txt", "mkdocs.yml"),
    *("README.md", "LICENSE", "CITATION.cff", "CHANGELOG.md", "SECURITY.md"),
)
"""Files and folders of the source archive; of a checkout that has them."""


def files(name: str) -> set[str]:
    """Return the files of a folder of the checkout, or a single one, as they are named there."""
    path = ROOT / name
    found = path.rglob("*") if path.is_dir() else [path]
    kept = (each for each in found if each.is_file() and "__pycache__" not in each.parts)
    return {str(each.relative_to(ROOT)) for each in kept}


def check_wheel(place: Place) -> None:
    """The library and the assets inside it, and nothing else."""
    with zipfile.ZipFile(place.wheel) as wheel:
        held = {name for name in wheel.namelist() if ".dist-info/" not in name}
    expected = files("fbid_gym") | {f"fbid_gym/{name}" for name in files("assets")}
    missing, strange = sorted(expected - held), sorted(held - expected)
    expect(not missing, f"the wheel does not hold {', '.join(missing[:5])}")
    expect(not strange, f"the wheel holds {', '.join(strange[:5])}")
    expect("fbid_gym/py.typed" in held, "the wheel does not say that it is typed")


def check_sdist(place: Place) -> None:
    """All that a checkout works with."""
    with tarfile.open(place.sdist) as sdist:
        held = {str(Path(*Path(name).parts[1:])) for name in sdist.getnames()}
    expected = set().union(*(files(name) for name in _SOURCES if (ROOT / name).exists()))
    missing = sorted(expected - held)
    expect(not missing, f"the source archive does not hold {', '.join(missing[:5])}")


def metadata(place: Place) -> email.message.Message:
    """Return what the wheel says of itself."""
    with zipfile.ZipFile(place.wheel) as wheel:
        (name,) = (name for name in wheel.namelist() if name.endswith(".dist-info/METADATA"))
        return email.parser.Parser().parsestr(wheel.read(name).decode("utf-8"))


def check_metadata(place: Place) -> None:
    """Name, version, interpreter, licence, classifiers and extras; a page's text in Markdown."""
    said, project = metadata(place), place.project
    pairs = {"Name": "name", "Version": "version", "Summary": "description"}
    pairs |= {"Requires-Python": "requires-python", "License-Expression": "license"}
    for field, name in pairs.items():
        expect(said[field] == project[name], f"{field} is {said[field]!r}, not {project[name]!r}")
    expect(said["License-File"] == "LICENSE", "no licence file is named")
    expect(said["Description-Content-Type"] == "text/markdown", "the page's text is no Markdown")
    expect(str(said.get_payload()).startswith("# fbid_gym"), "the page's text is not the README")
    for field, name in (("Classifier", "classifiers"), ("Provides-Extra", "optional-dependencies")):
        given, expected = said.get_all(field, []), project[name]
        assert isinstance(expected, list | dict)
        expect(set(given) == set(expected), f"{field} lists {given}, not {list(expected)}")
    for field in ("Home-page", "Project-URL", "Download-URL"):
        expect(said[field] is None, f"{field} is {said[field]!r}")


def check_licence(place: Place) -> None:
    """The licence is in the wheel as it is in the checkout."""
    with zipfile.ZipFile(place.wheel) as wheel:
        texts = [wheel.read(name) for name in wheel.namelist() if name.endswith("/LICENSE")]
    expect(texts == [(ROOT / "LICENSE").read_bytes()], "the wheel's licence is not the project's")


CHECKS = (
    Check("the wheel holds the library with robots and policies, and nothing else", check_wheel),
    Check("the wheel says what it is", check_metadata),
    Check("the wheel holds the licence", check_licence),
    Check("the source archive holds train/, eval/, tests and documentation, too", check_sdist),
)
