# The public names and where they are defined: read by type checkers, and by lazy_loader at run time.
from .batch.one_call import export
from .core.channels import RadioChannels
from .core.errors import ScarlError, ScarlWarning
from .core.mount import Mount
from .core.pose import Pose, Twist
from .core.results import ClosedRadarFrame, Frame, ImageFrame, LidarScan, RadarFrame
from .core.scans.radar import RadarScan
from .core.settings.accuracy import Accuracy
from .core.settings.auto import AutoSettings
from .core.settings.mirrors import MirrorSettings
from .core.settings.plan import ChannelPlan, Share
from .core.settings.radar import RadarSettings
from .core.settings.radio import RadioSettings
from .core.settings.raycast import RaycastSettings
from .core.settings.sbr import SbrSettings
from .core.settings.scanning import ScanningSettings
from .core.settings.scatterers import ScattererSettings
from .core.settings.sionna import SionnaSettings
from .core.settings.warn import WarningLevels
from .core.settings.weather_echoes import WeatherEchoSettings
from .core.specs.atmosphere import Atmosphere
from .core.specs.camera import BrownConrady, CameraSpec, ImageSensor, KannalaBrandt, Pinhole
from .core.specs.interferer import Interferer
from .core.specs.lidar.pattern import RasterScan, RisleyScan, SpinningScan, TableScan
from .core.specs.lidar.receiver import HeterodyneReceiver, PulsedReceiver, ScarlReceiver
from .core.specs.lidar.spec import LidarSpec
from .core.specs.lighting import Lighting
from .core.specs.radar.antennas.element import AntennaElement
from .core.specs.radar.antennas.fan import FanPattern
from .core.specs.radar.antennas.grid import GridPattern
from .core.specs.radar.antennas.radome import Radome, RadomeLayer
from .core.specs.radar.array import AntennaArray
from .core.specs.radar.closed.device import ClosedRadarSpec, MapAxes
from .core.specs.radar.closed.files import read_point_spread, write_point_spread
from .core.specs.radar.closed.table import PointSpread
from .core.specs.radar.converter import Adc
from .core.specs.radar.front_end import FrontEnd
from .core.specs.radar.impairments import (
    Amplifier,
    ChannelErrors,
    ChirpErrors,
    IfFilter,
    Leakage,
    Mixer,
    PhaseNoise,
)
from .core.specs.radar.multiplexing import Bpm, Cdm, Ddm, Fdm, IdealMimo, Tdm
from .core.specs.radar.scanning.spec import ScanningRadarSpec
from .core.specs.radar.spec import RadarSpec
from .core.specs.radar.waveform import Fmcw
from .core.specs.radar.waveforms.coded import Ofdm, Pmcw
from .core.specs.radar.waveforms.kinds import SteppedFmcw
from .core.specs.radar.waveforms.phase_coded import PcFmcw
from .core.specs.radio import RadioArray, RadioSpec, RadioStation
from .core.specs.weather import Weather
from .dataset.captures import read_capture
from .dataset.captures.capture import Capture
from .dataset.captures.map_capture import MapCapture
from .dataset.point_clouds import read_points
from .dataset.point_clouds.own import point_table
from .dataset.point_clouds.table import PointTable
from .dataset.readers.reader import Dataset, open_dataset
from .dataset.statistics.collect import DatasetStatistics, dataset_statistics
from .dataset.statistics.of_points import PointStatistics, count_points
from .engine.load import load_scene, stage
from .engine.world import World, WorldState
from .fusion import Rig
from .loop.motion import ActorPose
from .loop.session import Session
from .loop.settings import SessionSettings
from .radar.channel import plan_channel, solve_paths
from .radar.closed.known import closed_radar_of
from .radar.closed.maps import map_of_paths
from .radar.interference.beat import synthesize_interference
from .radar.interference.ways import one_way_paths
from .radar.labels.labels import label_cells, label_paths, label_points
from .radar.network.images import back_project
from .radar.network.suites import NetworkFrame, RadarNetwork, network_paths, synthesize_network
from .radar.paths import RadarPaths
from .radar.points import point_targets
from .radar.radome import RadomeEffect, radome_effect
from .radar.rcs import rcs
from .radar.scanning.turn import scan_paths
from .radar.scatterers.compile import compile_scatterers
from .radar.scatterers.model import ScattererModel
from .radar.synthesis import synthesize
from .radar.synthesis.blocks import retraced, synthesize_blocks
from .radar.weather.attenuation import attenuate_paths
from .scenario.spec.scenario import ScenarioSpec
from .scene.actors.body import actor_from_body
from .scene.actors.mesh import actor_from_mesh
from .scene.actors.model import ActorModel, read_actor_model
from .scene.document.staging import StagedActor
from .signal.angle import range_doppler_angle
from .signal.converter import quantize
from .signal.detection import detect
from .signal.detection.map_peaks import map_of_frame, peaks_of_map
from .signal.mitigation.hits import find_hits
from .signal.mitigation.repair import mitigate
from .signal.processing import range_doppler, virtual_cube
from .signal.radio import frequency_response
from .signal.tracking import RadarClusters, RadarTracks, cluster, track
from .simulation import observe, radar_cube, simulate

__all__ = [
    "Accuracy",
    "AutoSettings",
    "ChannelPlan",
    "MapCapture",
    "MirrorSettings",
    "Mount",
    "RadarSettings",
    "RaycastSettings",
    "SbrSettings",
    "ScanningSettings",
    "ScattererSettings",
    "Share",
    "SionnaSettings",
    "WarningLevels",
    "WeatherEchoSettings",
    "plan_channel",
    "ActorModel",
    "ActorPose",
    "Adc",
    "Amplifier",
    "AntennaArray",
    "AntennaElement",
    "Atmosphere",
    "Bpm",
    "BrownConrady",
    "CameraSpec",
    "Capture",
    "Cdm",
    "ChannelErrors",
    "ClosedRadarFrame",
    "ClosedRadarSpec",
    "ChirpErrors",
    "Ddm",
    "Fdm",
    "Fmcw",
    "Ofdm",
    "PcFmcw",
    "Pmcw",
    "Dataset",
    "DatasetStatistics",
    "Frame",
    "FrontEnd",
    "FanPattern",
    "GridPattern",
    "HeterodyneReceiver",
    "IdealMimo",
    "IfFilter",
    "ImageFrame",
    "ImageSensor",
    "Interferer",
    "KannalaBrandt",
    "Leakage",
    "LidarScan",
    "LidarSpec",
    "Lighting",
    "Mixer",
    "MapAxes",
    "NetworkFrame",
    "PhaseNoise",
    "Radome",
    "RadomeEffect",
    "RadomeLayer",
    "radome_effect",
    "Pinhole",
    "PointSpread",
    "PointStatistics",
    "PointTable",
    "Pose",
    "PulsedReceiver",
    "RadarFrame",
    "RadarClusters",
    "RadarNetwork",
    "RadarPaths",
    "RadarScan",
    "RadarSpec",
    "RadarTracks",
    "RadioArray",
    "RadioChannels",
    "RadioSettings",
    "RadioSpec",
    "RadioStation",
    "RasterScan",
    "Rig",
    "RisleyScan",
    "ScarlError",
    "ScanningRadarSpec",
    "ScenarioSpec",
    "ScarlReceiver",
    "ScarlWarning",
    "ScattererModel",
    "Session",
    "SessionSettings",
    "SpinningScan",
    "StagedActor",
    "SteppedFmcw",
    "TableScan",
    "Tdm",
    "Twist",
    "Weather",
    "World",
    "WorldState",
    "actor_from_body",
    "actor_from_mesh",
    "attenuate_paths",
    "back_project",
    "cluster",
    "compile_scatterers",
    "count_points",
    "dataset_statistics",
    "closed_radar_of",
    "detect",
    "export",
    "find_hits",
    "frequency_response",
    "label_cells",
    "label_paths",
    "label_points",
    "load_scene",
    "mitigate",
    "network_paths",
    "observe",
    "one_way_paths",
    "open_dataset",
    "peaks_of_map",
    "point_table",
    "point_targets",
    "map_of_frame",
    "map_of_paths",
    "quantize",
    "radar_cube",
    "range_doppler",
    "range_doppler_angle",
    "rcs",
    "read_actor_model",
    "read_capture",
    "read_point_spread",
    "read_points",
    "retraced",
    "scan_paths",
    "simulate",
    "solve_paths",
    "stage",
    "synthesize",
    "synthesize_blocks",
    "synthesize_interference",
    "synthesize_network",
    "write_point_spread",
    "track",
    "virtual_cube",
]

__version__: str
