"""One colour for each law, in every picture: plots, films and the live page."""

from redres_ros.laws import LAWS

LAW_COLOURS = {  # distinct for colour-blind readers too; red is left to limits and stops
    'minimum_velocity': '#e69f00',
    'minimum_acceleration': '#0072b2',
    'minimum_kinetic_energy': '#009e73',
    'minimum_weighted_torque': '#cc79a7',
    'dynamically_consistent': '#6a3d9a',
    'minimum_torque': '#56b4e9',
}
_OTHERS = ('#8c6d31', '#525252', '#637939', '#843c39')  # of laws that plugins add
LINE_STYLES = ('-', '--', ':', '-.')  # of several motions under one law


def law_colour(name: str) -> str:
    """The colour of a law, as '#rrggbb'.

    Args:
        name: In the table LAWS; what follows a comma, such as its damping, makes no difference.
    """
    law = name.partition(',')[0]
    if law in LAW_COLOURS:
        return LAW_COLOURS[law]
    others = [each for each in LAWS if each not in LAW_COLOURS]
    place = others.index(law) if law in others else len(others)
    return _OTHERS[place % len(_OTHERS)]


def line_styles(names: list[str]) -> dict[str, dict[str, str]]:
    """Colour and line style of motions by their names, for `Axes.plot`.

    Args:
        names: Of the motions, as law_colour takes them. Several of one law differ in their lines.
    """
    styles: dict[str, dict[str, str]] = {}
    counts: dict[str, int] = {}
    for name in names:
        colour = law_colour(name)
        count = counts.get(colour, 0)
        counts[colour] = count + 1
        styles[name] = {'color': colour, 'ls': LINE_STYLES[count % len(LINE_STYLES)]}
    return styles
