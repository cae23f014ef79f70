"""How figures name what they show: laws as in the table, units as they are written by hand."""

PER_SECOND = r's$^{-1}$'


def title(number: int, kind: str, text: str) -> str:
    """Of a figure.

    Args:
        number: In the paper, or beyond its last.
        kind: Simulation or experiment.
        text: What is shown.
    """
    return f'Figure {number}. {kind}: {text}'


def law(name: str, equation: str, T: float, damping: float | None = None) -> str:
    """A law with its parameters.

    Args:
        name: In the table of laws.
        equation: The paper's number.
        T: Sampling time [s].
        damping: k_d [1/s]; None for a law that has none.
    """
    return f'{name} ({equation}){gain(T, damping)}, T = {1e3 * T:g} ms'


def gain(T: float, damping: float | None) -> str:
    """The damping, and what it is as a forgetting factor; empty where there is none.

    Args:
        T: Sampling time [s].
        damping: k_d [1/s].
    """
    if damping is None:
        return ''
    factor = f'{1.0 - damping * T:.4g}'
    return rf', $k_d$ = {damping:g} {PER_SECOND} ($\lambda$ = {factor})'
