"""The documentation builds without warnings, its examples run, and quoted numbers are current."""

import importlib
import inspect
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from importlib.util import find_spec
from pathlib import Path

import matplotlib.pyplot as plt
import nbformat
import pytest
import yaml
from selenium.webdriver.support.ui import WebDriverWait

import gearlib
import gearlib.geometry
import gearlib.plot
from gearlib.studies.claims import CHECKS
from tests.browser.chromium import browser, console_errors

assert browser  # a fixture

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]
NOTEBOOK = DOCS / "from_geometry.ipynb"
#: Pages whose Python examples take longer than ten seconds; `make docs` runs them.
LONG_PAGES = ["tutorial_rig", "which_stiffness", "tolerances"]

DOCS_PACKAGES = "ipykernel material mkdocs_click mkdocstrings nbconvert ziamath".split()
needs_mkdocs = pytest.mark.skipif(
    not all(map(find_spec, DOCS_PACKAGES)),
    reason="mkdocs and its packages are not installed: pip install '.[docs]'",
)


def code_blocks(page, language):
    """Return the contents of the code blocks in a language on a page."""
    text = page.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.S | re.M)


def pages_with_code_blocks(language):
    """Return test parameters for the pages that have code blocks in a language."""
    pages = [page for page in PAGES if code_blocks(page, language)]
    assert pages
    return [
        pytest.param(
            page,
            id=str(page.relative_to(ROOT)),
            marks=[pytest.mark.release] if page.stem in LONG_PAGES else [],
        )
        for page in pages
    ]


@pytest.fixture
def import_hook(monkeypatch):
    """Return a function that imports a hook of the site by its name."""
    monkeypatch.syspath_prepend(str(DOCS / "hooks"))
    return importlib.import_module


@pytest.mark.parametrize("page", pages_with_code_blocks("python"))
def test_python_examples_print_the_output_shown_below_them(page, tmp_path, monkeypatch, capsys):
    """Run the code blocks of a page in order; output and saved pictures must be as shown there."""
    plt.switch_backend("Agg")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "config.yaml").write_bytes((ROOT / "config.yaml").read_bytes())
    (tmp_path / "gallery").symlink_to(ROOT / "gallery")
    text = page.read_text(encoding="utf-8")
    namespace = {}
    # A code block, and the text block with its output if one follows.
    pattern = r"^```python\n(.*?)^```(?:\n\n```text\n(.*?)^```)?"
    for code, expected_output in re.findall(pattern, text, re.S | re.M):
        exec(compile(code, page.name, "exec"), namespace)
        assert capsys.readouterr().out == expected_output or page.name == "README.md"
    plt.close("all")
    for picture in re.findall(r'savefig\("([^"]+)"', text):
        assert (tmp_path / picture).stat().st_size > 1000
        assert page.name == "README.md" or (DOCS / "images" / picture).is_file()
    for picture in re.findall(r"!\[[^]]*\]\((images/[^)]+)\)", text):
        assert (page.parent / picture).is_file()


def test_numbers_in_the_worked_example_appear_in_printed_output():
    """Each bold number in the text must also occur in the output of an example."""
    page = DOCS / "worked_example.md"
    prose = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.S | re.M)
    bold_numbers = re.findall(r"\*\*([^*]+)\*\*", prose)
    printed_numbers = re.findall(r"[\d.]+\d|\d", "".join(code_blocks(page, "text")))
    assert len(bold_numbers) > 10 and {*bold_numbers} <= {*printed_numbers}


@pytest.mark.parametrize("page", pages_with_code_blocks("yaml"))
def test_yaml_examples_are_accepted_as_changes_of_the_configuration(page):
    """Users copy these examples to config.yaml, so that they must be valid there."""
    from gearlib import config
    from gearlib.config import overlay

    for block in code_blocks(page, "yaml"):
        settings = yaml.safe_load((ROOT / "config.yaml").read_text(encoding="utf-8"))
        settings = overlay(settings, yaml.safe_load(block))
        if "gears" in settings:
            # Settings of gear geometry are also a complete configuration by themselves.
            assert config.load(yaml.safe_load(block))
        else:
            assert config.load(settings)


def test_commands_in_the_pages_succeed_within_eighty_columns(tmp_path, monkeypatch):
    """Each command on a page must run, or have the options that its help lists."""
    from click.testing import CliRunner

    from gearlib.cli.commands import main

    (tmp_path / "config.yaml").write_bytes((ROOT / "config.yaml").read_bytes())
    shutil.copytree(
        ROOT / "gallery", tmp_path / "gallery", ignore=shutil.ignore_patterns("results")
    )
    commands = []
    for block in (block for page in PAGES for block in code_blocks(page, "sh")):
        folder = tmp_path
        for line in block.splitlines():
            if line.startswith("cd "):
                folder = folder / line.removeprefix("cd ")
            elif line.startswith("gearlib "):
                commands.append((folder, shlex.split(line)))
    assert len(commands) > 4
    # The output of `orbit` has long lines that must be wrapped.
    orbit = shlex.split("gearlib orbit --model train --period 3 --tuning 0.7")
    commands += [(tmp_path, orbit), *((tmp_path, ["gearlib", x, "-h"]) for x in main.commands)]
    for folder, (_, name, *options) in commands:
        monkeypatch.chdir(folder)
        # The explorer would run until it is stopped, `trust` takes seconds, and `fit`, `compare`
        # and `fmu` need data. Only the options of these commands are checked.
        help_only = name in ("explore", "trust", "fit", "compare", "fmu")
        if name == "workflow" and options != ["-h"]:
            # A dry run is sufficient, because tests/wheel runs the workflow.
            options = [option for option in options if "report" not in option] + ["-n"]
        result = CliRunner().invoke(main, [name, *(["--help"] if help_only else options)])
        assert result.exit_code == 0, result.output
        # Snakemake itself prints longer lines.
        fits = all(len(line) <= 80 for line in result.output.splitlines())
        assert fits or name == "workflow", result.output
        for option in options if help_only else ():
            assert not option.startswith("-") or option in result.output


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Build the documentation without warnings and return its folder."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet"]
    result = subprocess.run(
        [*command, "--site-dir", folder], cwd=ROOT, capture_output=True, text=True
    )
    assert result.returncode == 0, result.stdout + result.stderr
    return folder


@pytest.mark.release
@needs_mkdocs
@pytest.mark.parametrize("page", ["index.html", "how_to/explorer.html"])
def test_pages_opened_as_files_can_be_searched(site, browser, page):
    """The search must work without a server, and its first result must be an existing page."""
    browser.get((site / page).as_uri())
    field = browser.find_element("css selector", ".md-search__input")
    field.click()
    field.send_keys("backlash")
    links = WebDriverWait(browser, 30).until(
        lambda driver: driver.find_elements("css selector", ".md-search-result__item a")
    )
    address = re.split("[#?]", links[0].get_attribute("href"))[0]
    assert (site / Path(address).relative_to(site.as_uri())).exists()
    assert console_errors(browser) == []


@pytest.mark.release
@needs_mkdocs
def test_the_notebook_is_executed_and_shows_each_figure_once(site):
    """The stored notebook must have no output, and the site must show the output of each cell."""
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbformat.validate(notebook)
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert not any(cell.outputs or cell.execution_count for cell in cells)
    text = (site / NOTEBOOK.with_suffix(".html").name).read_text(encoding="utf-8")
    pictures = re.findall(rf'src="({NOTEBOOK.stem}_\d+_\d+\.png)"', text)
    drawing_call = r"plot\.\w+\(|subplots\(|Image\("
    drawing_cells = [cell for cell in cells if re.search(drawing_call, cell.source)]
    assert len(pictures) == len({*pictures}) == len(drawing_cells) > 4
    assert all((site / name).stat().st_size > 1000 for name in pictures)
    # The mesh frequency of 23 teeth at 6000 rpm = 100 Hz is 2300 Hz.
    assert re.search(r"mesh frequency +2300 Hz", text) and (site / NOTEBOOK.name).is_file()


@pytest.mark.release
@needs_mkdocs
def test_the_site_fetches_nothing_from_the_network(site):
    """No script, style sheet, image or formula may need a network, so that pages work offline."""
    pages = list(site.rglob("*.html"))
    assert len(pages) > len(PAGES)
    fetched_address = r'<(?:script|link|img)[^>]+(?:src|href)="(https?:[^"]+)"'
    for page in pages:
        text = page.read_text(encoding="utf-8")
        addresses = re.findall(fetched_address, text)
        assert not addresses, f"{page.name} fetches {addresses}"
        assert "arithmatex" not in text, f"{page.name} has a formula that was not converted"


@pytest.mark.release
@needs_mkdocs
def test_the_python_reference_contains_public_names_and_parameters(site):
    """All public names must have an entry, and parameters of models their description."""
    text = (site / "reference/api.html").read_text(encoding="utf-8")
    for module in (gearlib, gearlib.geometry, gearlib.plot):
        missing = [name for name in module.__all__ if f'id="{module.__name__}.{name}"' not in text]
        assert missing in ([], ["RACKS"])  # a dictionary without a docstring
    for description in ("Maximum mesh stiffness C_max, N/m.", "Number of planets."):
        assert description in text


def test_documented_claims_match_the_code_and_give_a_reason(import_hook):
    """The claims on the page must be those that the code checks, each with a reason."""
    evidence = import_hook("evidence")
    claims = evidence.read("claims")
    statements = claims[["id", "statement", "where", "figure"]].itertuples(index=False, name=None)
    assert [*statements] == [check[:4] for check in CHECKS]
    assert [*evidence.reasons()] == [*claims.id]


def test_instability_quoted_for_claim_p4_matches_the_library(import_hook):
    """The reason of claim P4 must quote the ends of the third tongue with four decimal places."""
    from gearlib.analysis.tongues import meissner
    from tests.paper import PAPER_PAIR

    third_tongue = meissner.find_tongue(meissner.equation_of_pair(PAPER_PAIR), 3)
    reason = import_hook("evidence").reasons()["P4"]
    assert f"from {third_tongue.start:.4f} to {third_tongue.stop:.4f}" in reason


def test_quoted_proven_ranges_end_where_the_branches_graze(import_hook):
    """Proven ranges without contact loss must end where the branch grazes, see claims P4 to P7."""
    tongue, branches, proven = import_hook("evidence").quoted_numbers().values()
    # Claim P10 quotes this cause of instability.
    assert tongue["k1m"]["cause"] == "parametric instability"
    # Claim P6 makes the same statement for the dampings k1+k1m and k1.
    ranges = [[row["tuning"] for row in proven[k]["range D"]] for k in ("k1", "k1+k1m")]
    assert ranges[0] == ranges[1]
    assert branches["k1"]["grazing"][-2:] == branches["k1+k1m"]["grazing"][-2:]
    for damping in ("conservative", "k1", "k1m"):
        *_, grazing, next_grazing = branches[damping]["grazing"]
        *_, below, above = proven[damping]["range D"]
        # Proven ranges end just before a grazing and start just after the next one.
        assert 0.0 < grazing - below["until"] < 2e-4
        assert 0.0 < above["tuning"] - next_grazing < 2e-4


def test_quoted_stability_matches_the_certificates(import_hook):
    """The stability in the reasons of claims P4, P7 and P10 must be the certified one."""
    proven = import_hook("evidence").quoted_numbers()["proven"]
    assert {row["stability"] for row in proven["k1"]["range D"]} == {"stable"}
    # Of the four orbits only the second, in a tongue, is unstable. The others have both multipliers
    # on the unit circle.
    for damping, kinds in (
        ("conservative", ["range D"]),
        ("k1m", ["orbit 0.6", "orbit 0.66", "orbit 0.78", "orbit 1.14"]),
    ):
        rows = [row for kind in kinds for row in proven[damping][kind] if row["contacts"] == "D"]
        assert [row["stability"] == "unstable" for row in rows] == [False, True, False, False]
        assert sum("exactly on the unit circle" in row["reason"] for row in rows) == 3
    for damping in ("k1", "k1+k1m"):
        (orbit,) = proven[damping]["orbit 1.14"]
        assert (orbit["contacts"], orbit["stability"]) == ("D", "stable")


def test_motions_from_rest_reach_the_quoted_orbits(import_hook):
    """Motions from rest must have the quoted labels and, for claim P11, reach the small orbit."""
    evidence = import_hook("evidence")
    motions = evidence.read("labels").set_index(["damping", "tuning"])
    for nu in (0.6, 0.66, 0.78, 0.8, 0.81, 0.82, 1.14):
        for damping in ("k1", "k1+k1m", "k1m"):
            is_periodic = [*motions.loc[(damping, nu)]] == ["periodic", 1]
            assert is_periodic == (damping != "k1m" or 0.8 <= nu < 1.0)
    # For P11 there are two stable orbits, of which the motion from rest reaches the small one.
    computed = evidence.read("claims").set_index("id").computed["P11"]
    for nu in (0.815, 0.8151):
        small, _, large = evidence.quoted_numbers()["proven"]["k1"][f"orbit {nu}"]
        assert small["stability"] == large["stability"] == "stable"
        assert small["lowest"] > large["lowest"]
        assert f"{small['lowest']:.4g} at nu = {nu}," in computed


@pytest.mark.release
@needs_mkdocs
def test_every_configuration_key_is_documented(import_hook):
    """Each key of the schema must occur in the tables of the configuration page."""
    from gearlib.config import schema

    page = import_hook("configuration").tables()
    nodes = [schema(), *schema()["$defs"].values()]
    keys = {key for node in nodes for key in node.get("properties", {})}
    # Keys appear in the first column of tables or in headings, nested ones as `section.key`.
    described = re.findall(r"^\| `([^`]+)`|^## (.+)", page, re.M)
    assert keys <= set(re.findall(r"\w+", " ".join(map(" ".join, described))))
    assert "None" not in page


def test_the_architecture_picture_orders_subpackages_by_their_imports():
    """Boxes of higher layers must be drawn above the layers that they may import."""
    svg = (DOCS / "images/architecture.svg").read_text(encoding="utf-8")
    boxes = re.findall(r'class="room" x="\d+" y="(\d+)".*>(.+)<', svg)
    heights = {name: int(y) for y, name in boxes}
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    layers = settings["tool"]["importlinter"]["contracts"][0]["layers"]
    names = [name for layer in layers for name in re.split(r" [|:] ", layer)]
    # The picture shows packages only, no single modules.
    packages = [name for name in names if (ROOT / "gearlib" / name).is_dir()]
    assert set(heights) == set(packages)
    order = [heights[name] for name in packages]
    # More than seven rows of boxes are hard to read.
    assert order == sorted(order) and len(set(order)) <= 7


def test_names_in_the_glossary_exist_in_the_code():
    """Each quoted name must be a public name, its attribute or argument, or a dataset variable."""
    from gearlib.data.variables import DESCRIPTIONS

    public = [(name, getattr(gearlib, name)) for name in gearlib.__all__]
    public += [
        (name, getattr(gearlib.geometry, name))
        for name in gearlib.geometry.__all__
        if name != "RACKS"
    ]
    known_names = {"gearlib.geometry", *dict(public), *DESCRIPTIONS}
    for name, public_object in public:
        arguments = inspect.signature(public_object).parameters
        attributes = [f"{name}.{attribute}" for attribute in [*arguments, *dir(public_object)]]
        known_names |= {*arguments, *attributes}
    text = (DOCS / "glossary.md").read_text(encoding="utf-8")
    quoted = re.findall(r"`([^`]+)`", text.split("\n## ", 1)[1])
    assert len(quoted) > 50
    # `direction="up"` refers to the argument `direction`; further values are quoted alone.
    names = {name.split("=")[0] for name in quoted if not name.startswith('"')}
    assert names <= known_names


def test_the_glossary_has_at_most_60_terms():
    """A longer glossary would not be read."""
    text = (DOCS / "glossary.md").read_text(encoding="utf-8").split("\n## Words that")[0]
    rows = re.findall(r"^\|(?!-|term)", text, re.M)
    assert len(rows) <= 60


def test_no_public_text_uses_words_that_the_glossary_avoids():
    """Pages, captions, configurations and public docstrings must use the words of the glossary."""
    glossary = (DOCS / "glossary.md").read_text(encoding="utf-8")
    avoided = re.findall(r'"([^"]+)"', glossary.split("\n## Words that gearlib avoids")[1])
    assert len(avoided) > 10
    pages = [*DOCS.rglob("*.md"), *DOCS.rglob("*.ipynb"), *(ROOT / "workflow").rglob("*.rst")]
    pages += [ROOT / "README.md", ROOT / "config.yaml", *ROOT.glob("gallery/*/config.yaml")]
    texts = {path.name: path.read_text(encoding="utf-8") for path in pages}
    del texts["glossary.md"]
    texts |= {name: inspect.getdoc(getattr(gearlib, name)) or "" for name in gearlib.__all__}
    pattern = re.compile("|".join(map(re.escape, avoided)), re.IGNORECASE)
    used = {name: pattern.findall(text) for name, text in texts.items() if pattern.search(text)}
    assert not used
