"""Who there is: age, height, build and clothes of each body."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

YEARS = ((1.0, 0.0), (11.0, 0.1875), (25.0, 0.5), (90.0, 1.0))
"""Years, and where MakeHuman has them between its targets."""


@dataclass(frozen=True)
class Person:
    """One row.

    Attributes
    ----------
    name : str
        What the body is called in scenes.
    female : bool
    years : int
    height : float
        Without shoes [m].
    muscle, weight : float
        0 to 1; 0.5 is the mean.
    origins : tuple of float
        Shares of MakeHuman's African, Asian and Caucasian faces.
    top, bottom : str
        Clothes, see `scenes_xml.generators.people.garments.outfit`.
    hair : float
        Thickness [m].
    long_hair : bool
    arms_out_deg : float
        How far the arms hang off the body.
    """

    name: str
    female: bool
    years: int
    height: float
    muscle: float
    weight: float
    origins: tuple[float, float, float]
    top: str
    bottom: str
    hair: float
    long_hair: bool = False
    arms_out_deg: float = 8.0

    @property
    def age(self) -> float:
        """Where MakeHuman has the age between its targets, 0 to 1."""
        return float(np.interp(self.years, *np.transpose(YEARS)))


F, M = True, False
AFRICAN, ASIAN, CAUCASIAN, MIXED = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.34, 0.33, 0.33)
PEOPLE = (
    Person("girl_3", F, 3, 0.95, 0.5, 0.5, CAUCASIAN, "t_shirt", "skirt", 0.010, True),
    Person("boy_4", M, 4, 1.02, 0.5, 0.5, ASIAN, "t_shirt", "shorts", 0.012),
    Person("girl_5", F, 5, 1.09, 0.5, 0.45, AFRICAN, "dress", "", 0.016),
    Person("boy_6", M, 6, 1.16, 0.5, 0.55, CAUCASIAN, "jacket", "trousers", 0.012),
    Person("girl_7", F, 7, 1.22, 0.5, 0.5, MIXED, "shirt", "trousers", 0.010, True),
    Person("boy_8", M, 8, 1.28, 0.5, 0.5, AFRICAN, "shirt", "trousers", 0.004),
    Person("girl_9", F, 9, 1.34, 0.5, 0.55, ASIAN, "coat", "trousers", 0.010, True),
    Person("boy_10", M, 10, 1.39, 0.5, 0.7, CAUCASIAN, "t_shirt", "trousers", 0.014, False, 10.0),
    Person("girl_12", F, 12, 1.52, 0.45, 0.45, CAUCASIAN, "jacket", "trousers", 0.012, True),
    Person("boy_13", M, 13, 1.57, 0.5, 0.45, MIXED, "shirt", "shorts", 0.018),
    Person("girl_15", F, 15, 1.63, 0.5, 0.5, AFRICAN, "t_shirt", "trousers", 0.022),
    Person("boy_16", M, 16, 1.75, 0.55, 0.4, CAUCASIAN, "jacket", "trousers", 0.016),
    Person("man_18", M, 18, 1.80, 0.6, 0.45, ASIAN, "t_shirt", "trousers", 0.016),
    Person("woman_19", F, 19, 1.67, 0.5, 0.4, CAUCASIAN, "t_shirt", "shorts", 0.012, True),
    Person("man_22", M, 22, 1.86, 0.75, 0.45, AFRICAN, "t_shirt", "shorts", 0.005),
    Person("woman_23", F, 23, 1.60, 0.5, 0.45, ASIAN, "dress", "", 0.012, True),
    Person("man_27", M, 27, 1.78, 0.6, 0.5, CAUCASIAN, "shirt", "trousers", 0.013),
    Person("woman_28", F, 28, 1.72, 0.6, 0.45, AFRICAN, "jacket", "trousers", 0.020),
    Person("man_33", M, 33, 1.71, 0.5, 0.6, ASIAN, "jacket", "trousers", 0.010),
    Person("woman_34", F, 34, 1.66, 0.5, 0.5, CAUCASIAN, "coat", "trousers", 0.012, True),
    Person("man_38", M, 38, 1.92, 0.6, 0.55, CAUCASIAN, "shirt", "trousers", 0.008),
    Person("woman_39", F, 39, 1.58, 0.45, 0.7, MIXED, "shirt", "trousers", 0.012, True, 10.0),
    Person("man_44", M, 44, 1.75, 0.55, 0.75, AFRICAN, "shirt", "trousers", 0.0, False, 11.0),
    Person("woman_46", F, 46, 1.64, 0.5, 0.6, ASIAN, "jacket", "skirt", 0.016),
    Person("man_51", M, 51, 1.79, 0.5, 0.65, CAUCASIAN, "coat", "trousers", 0.008, False, 9.0),
    Person("woman_52", F, 52, 1.69, 0.5, 0.85, CAUCASIAN, "shirt", "trousers", 0.018, False, 12.0),
    Person("man_58", M, 58, 1.74, 0.5, 0.9, MIXED, "jacket", "trousers", 0.006, False, 13.0),
    Person("woman_61", F, 61, 1.62, 0.45, 0.55, AFRICAN, "coat", "skirt", 0.018),
    Person("man_66", M, 66, 1.73, 0.4, 0.6, CAUCASIAN, "t_shirt", "shorts", 0.0, False, 9.0),
    Person("woman_70", F, 70, 1.59, 0.4, 0.6, CAUCASIAN, "dress", "", 0.020, False, 9.0),
    Person("man_79", M, 79, 1.68, 0.35, 0.45, ASIAN, "jacket", "trousers", 0.006),
    Person("woman_82", F, 82, 1.54, 0.35, 0.5, CAUCASIAN, "jacket", "trousers", 0.018),
)
"""All bodies, by age."""
