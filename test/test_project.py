"""The files around the package say the same as each other, and as the package."""

import json
import re
import tomllib
from pathlib import Path
from xml.etree import ElementTree

import yaml
from imports import ROS, imports

ROOT = Path(__file__).resolve().parents[1]
SETUP = (ROOT / 'setup.py').read_text(encoding='utf-8')


def package(tag: str) -> str:
    """The text of an element of package.xml."""
    return ElementTree.parse(ROOT / 'package.xml').getroot().findtext(tag, '')


def test_who_cites_the_software_names_its_version_and_licence() -> None:
    citation = yaml.safe_load((ROOT / 'CITATION.cff').read_text(encoding='utf-8'))
    assert citation['title'] == package('name')
    assert citation['version'] == package('version')
    assert citation['license'] == package('license')
    assert citation['abstract'] == package('description')


def test_the_changelog_is_kept_by_the_book() -> None:
    changelog = (ROOT / 'CHANGELOG.md').read_text(encoding='utf-8')
    headings = re.findall(r'^## (.*)$', changelog, re.MULTILINE)
    assert headings[0] == '[Unreleased]'
    assert all(re.fullmatch(r'\[\d+\.\d+\.\d+\] - \d{4}-\d\d-\d\d', h) for h in headings[1:])
    assert headings[1].startswith(f'[{package("version")}] ')  # the newest release
    kinds = re.findall(r'^### (.*)$', changelog, re.MULTILINE)
    assert set(kinds) <= {'Added', 'Changed', 'Deprecated', 'Removed', 'Fixed', 'Security'}


def test_the_hooks_before_a_commit_run_the_ruff_that_the_tests_run() -> None:
    hooks = yaml.safe_load((ROOT / '.pre-commit-config.yaml').read_text(encoding='utf-8'))
    [revision] = [repo['rev'] for repo in hooks['repos'] if 'ruff' in repo['repo']]
    assert f"'ruff=={revision.removeprefix('v')}'" in SETUP


def test_every_python_that_is_promised_is_tested() -> None:
    promised = re.findall(r'Python :: (3\.\d+)', SETUP)
    workflow = yaml.safe_load((ROOT / '.github/workflows/tests.yaml').read_text(encoding='utf-8'))
    assert workflow['jobs']['test']['strategy']['matrix']['python'] == promised


def test_types_are_checked_by_strict_rules_and_no_file_is_exempt() -> None:
    mypy = tomllib.loads((ROOT / 'pyproject.toml').read_text(encoding='utf-8'))['tool']['mypy']
    assert mypy['strict'] is True
    assert 'redres_ros' in mypy['files']
    assert not any('ignore_errors' in override for override in mypy['overrides'])


def test_every_workflow_names_files_and_extras_that_exist() -> None:
    for path in (ROOT / '.github' / 'workflows').glob('*.yaml'):
        text = path.read_text(encoding='utf-8')
        assert yaml.safe_load(text)['jobs']
        for extra in re.findall(r"'\.\[(\w+)\]'", text):
            assert f"'{extra}': " in SETUP


def test_the_container_for_developers_installs_what_the_tests_need() -> None:
    container = json.loads((ROOT / '.devcontainer/devcontainer.json').read_text(encoding='utf-8'))
    assert "'.[test]'" in container['postCreateCommand']


def test_every_ros_package_that_is_imported_is_a_dependency_of_the_package() -> None:
    named = {e.text for e in ElementTree.parse(ROOT / 'package.xml').getroot()}
    imported = {found.library for found in imports() if re.fullmatch(ROS, found.library)}
    assert 'sensor_msgs' in imported
    assert sorted(imported - named) == []
