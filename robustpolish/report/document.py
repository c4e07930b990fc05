"""What a report consists of, whatever it reports."""

from __future__ import annotations

from dataclasses import dataclass

from matplotlib.figure import Figure

from robustpolish.display import Table


@dataclass(frozen=True, eq=False)
class Picture:
    """A figure with a caption; it can be zoomed.

    Attributes
    ----------
    caption : str
    figure : matplotlib.figure.Figure
    """

    caption: str
    figure: Figure


@dataclass(frozen=True, eq=False)
class Section:
    """A heading with paragraphs, pictures and tables.

    Attributes
    ----------
    title : str
    text : tuple of str
        Paragraphs.
    pictures : tuple of Picture
    tables : tuple of Table
    points : tuple of str
        A list below the paragraphs.
    """

    title: str
    text: tuple[str, ...] = ()
    pictures: tuple[Picture, ...] = ()
    tables: tuple[Table, ...] = ()
    points: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Report:
    """A report: the verdict first, then the evidence.

    Attributes
    ----------
    title : str
    verdict : str
        One or two sentences.
    good : bool
        Whether the verdict is good news, which sets its colour.
    sections : tuple of Section
    """

    title: str
    verdict: str
    good: bool
    sections: tuple[Section, ...]
