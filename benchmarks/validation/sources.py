"""Where the measured figures of the rows come from: what was read, and whether it was the original.

Keys are used by the rows; every text says how it was read. Figures of other people's records only, no data of theirs.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Source:
    """A source: `kind` is measured, data set, standard or maker; `read` says which text was read."""

    citation: str
    kind: str
    read: str


_SURVEY = "second hand: elliott-dp/drone-companion, radar_dsp_ml_survey.md, Part H"
_MATHWORKS = "second hand: tabled in MathWorks' bicyclistrcs.m"
_WENGERTER = "second hand: thomaswengerter/FMCW_Radar_Target_Simulator"
_ACCONEER = "Acconeer handbook, radar_principles.rst, values collected there from databases; 60 GHz, real part only"

SOURCES = {
    "ulaby": Source(
        "Ulaby, Nashashibi, Sarabandi, terrain at 94 to 95 GHz, IEEE Trans. Antennas Propag., 1997 and 1998",
        "measured",
        _SURVEY,
    ),
    "ulaby_grazing": Source(
        "Ulaby et al., 95 GHz scattering by terrain near grazing, IEEE Trans. Antennas Propag. 46(1), 1998",
        "measured",
        "pages of the article",
    ),
    "jrc": Source(
        "Fortuny-Guasch, Chareau, Radar Cross Section Measurements of Pedestrian Dummies and Humans in the 24/77 "
        "GHz Frequency Bands, JRC EUR 25762 EN, 2013",
        "measured",
        "second hand: figures of Appendix D in a project's notes",
    ),
    "schubert": Source(
        "Schubert, Kunert, Menzel et al., IRS 2013",
        "measured",
        "second hand: elliott-dp/drone-companion, survey B.12",
    ),
    "deep": Source(
        "Deep et al., arXiv 1910.13706 (ray tracing of a walker, compared with measured Doppler)",
        "simulated by others",
        "second hand",
    ),
    "owda": Source(
        "Owda, Salmon, Sensors, 2020 (50 people); 0.606 of 60 people in their paper of SPIE Security + Defence, 2020",
        "measured",
        "abstracts",
    ),
    "belgiovane": Source("Belgiovane, Chen, EuCAP 2016, bicycle with rider", "measured", _MATHWORKS),
    "acea": Source(
        "ACEA, bicyclist target specifications, 2018 (after the CATS/4a consortium's of 2016)",
        "standard",
        "second hand: A. Nielsen, bicycle radar corner reflector, apnielsen.com, 2024",
    ),
    "bicyclist": Source("T. Wengerter, Bicyclist.m, called measured there, +-3 dB", "measured", _WENGERTER),
    "geary": Source("Geary, motorcycle, as quoted by T. Wengerter in Bicyclist.m, +-3 dB", "measured", _WENGERTER),
    "cars": Source(
        "T. Wengerter, Car.m: one car called measured there, and S. Abadpour (KIT), both sides of a car, +-3 dB",
        "measured",
        _WENGERTER + "; examples/calibration_data/car_rcs_77ghz.csv",
    ),
    "3gpp": Source(
        "3GPP TR 38.901 v19, clause 7.9.2 (fitted to measurements of its contributors)", "standard", "Sionna RT 2.2.0"
    ),
    "radarscenes": Source(
        "RadarScenes (arXiv 2104.02493), evaluation of its training split by others",
        "data set",
        "brunopinto900/radar-ml-autonomous-driving, EDA.md",
    ),
    "bumpers": Source(
        "bumper samples in W band, free space, 2015 (SafetyLit citjournalarticle_771166_9)", "measured", "abstract"
    ),
    "acconeer": Source("Acconeer handbook", "compiled", _ACCONEER),
    "zhekov": Source(
        "Zhekov, Franek, Pedersen, IEEE Antennas Propag. Mag., 2020: 0.2 to 67 GHz, at 77 GHz by their Cole-Cole model",
        "measured",
        "abstract; second hand: indices of refraction in OpenMATERIAL, issue 10",
    ),
    "foliage_73": Source(
        "Rappaport, Deng, 73 GHz foliage and ground reflection, IEEE ICC Workshops 2015", "measured", "abstract"
    ),
    "foliage_80": Source("Zavorka et al., IEEE Access, 2024, tree in leaf against bare", "measured", "abstract"),
    "birmingham": Source(
        "literature cited in the introduction of Sensors 21(9), 2954, 2021", "measured", "abstract and introduction"
    ),
    "matrosov": Source(
        "Matrosov, J. Atmos. Sci. 64, 2007: Z = 10 S^0.8, measured snowfalls within 5 dB",
        "measured",
        "as in tests/physics/test_weather_drops.py",
    ),
    "joss": Source(
        "drop sizes of Marshall and Palmer 1948 and Joss et al. 1968 (drizzle, widespread rain, thunderstorm)",
        "measured",
        "as in radar/weather/hydrometeors.py",
    ),
    "gunn": Source(
        "R. Gunn, G. D. Kinzer, J. Meteor. 6, 1949", "measured", "as in tests/physics/test_weather_drops.py"
    ),
    "p2040_4": Source(
        "Recommendation ITU-R P.2040-4, order of magnitude",
        "standard",
        "second hand: elliott-dp/drone-companion, radar_dsp_ml_survey.md",
    ),
    "awr1642": Source(
        "three static captures of OnurhanTALAN/mmwave-signal-processing, evaluated by this project",
        "measured",
        "the captures",
    ),
    "awr1642_held_out": Source(
        "five other recordings of the same project, of another day, read and evaluated by this project",
        "measured",
        "the captures",
    ),
    "cascade": Source(
        "Texas Instruments SWRU553A, MMWCAS-RF-EVM", "maker", "second hand: elliott-dp/drone-companion, findings"
    ),
    "jitter": Source("Texas Instruments SPRACV2, jitter of chirp starts", "maker", "the note"),
    "iwr1843": Source("Texas Instruments SWRS228A, IWR1843, section 8.7", "maker", "data sheet"),
}
