"""The demo in Python: the same bytes as ``scarl-sionna demo --scenario examples/highway_demo.yaml``.

python examples/highway_demo.py [OUT]
"""

from __future__ import annotations

import sys

from scarl_sionna.app.demo import RunSummary, run
from scarl_sionna.scenario.spec.scenario import ScenarioSpec

SCENARIO = ScenarioSpec(
    scene="highway_guardrail", rig="front", quality="draft", num_frames=5, frame_rate=10.0, start_time=0.0, seed=0
)


def main(out: str = "demo_out", scenario: ScenarioSpec = SCENARIO) -> RunSummary:
    """Write the scenario's frames and contact sheet into a folder."""
    return run(scenario, out, on_stage=lambda stage, done: print(f"{done:5.2f} {stage}", file=sys.stderr))


if __name__ == "__main__":
    print(main(sys.argv[1]) if len(sys.argv) > 1 else main())
