"""The paper's figures from result files. Drawing is a function of results and never trains."""

NUMBERS = (5, 6, 7, 8, 9)
"""The figures' numbers in the paper."""


def check_numbers(numbers: tuple[int, ...]) -> None:
    """Raises ValueError naming what is no number of a figure."""
    if unknown := sorted(set(numbers) - set(NUMBERS)):
        raise ValueError(f"only: {unknown}; allowed: {', '.join(map(str, NUMBERS))}")
