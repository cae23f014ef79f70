"""The files around the package say the same as each other, and as the package."""

import re
from pathlib import Path
from xml.etree import ElementTree

import yaml
from imports import ROS, imports

ROOT = Path(__file__).resolve().parents[1]


def package(tag: str) -> str:
    return ElementTree.parse(ROOT / 'package.xml').getroot().findtext(tag, '')


def test_who_cites_the_software_names_its_version_and_licence() -> None:
    citation = yaml.safe_load((ROOT / 'CITATION.cff').read_text(encoding='utf-8'))
    assert citation['version'] == package('version')
    assert citation['license'] == package('license')


def test_the_newest_release_in_the_changelog_is_this_version() -> None:
    changelog = (ROOT / 'CHANGELOG.md').read_text(encoding='utf-8')
    releases = re.findall(r'^## \[(\d\S*)\]', changelog, re.MULTILINE)
    assert releases[0] == package('version')


def test_every_ros_package_that_is_imported_is_a_dependency_of_the_package() -> None:
    named = {e.text for e in ElementTree.parse(ROOT / 'package.xml').getroot()}
    imported = {found.library for found in imports() if re.fullmatch(ROS, found.library)}
    assert 'sensor_msgs' in imported
    assert sorted(imported - named) == []
