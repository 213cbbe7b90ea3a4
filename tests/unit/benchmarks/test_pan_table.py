"""What the table of the virtual pan says of outcomes."""

from __future__ import annotations

from benchmarks.virtual_pan import lines_of, row
from heel.services.loops.panning.episode import PanOutcome

KEPT = PanOutcome(1, visible=104, since_chosen=100, in_window=100, kept=96, wrong=0,
               lost=[(7, "occluded")] * 4)  # fmt: skip
LOST = PanOutcome(2, visible=100, since_chosen=100, in_window=50, kept=20, wrong=10, acted_wrong=4,
               lost=[(21, "following"), (100, "lost")])  # fmt: skip
NEVER = PanOutcome(3, visible=96)


def test_shares_are_over_all_people_s_frames_since_they_were_chosen() -> None:
    # kept 116 of 200, in window 150, wrong 10, acted upon 4; of all 300 frames 116 were kept.
    assert row("A", "pixels", [KEPT, LOST, NEVER]) == (
        "| A | pixels | 3 | 2 | 58.0 | 75.0 | 5.0 | 2.0 | 1 | 38.7 |"
    )


def test_whoever_was_lost_or_never_chosen_is_named() -> None:
    lines = lines_of([PanOutcome(4, 50, 50, 50, 50), LOST, NEVER])
    assert len(lines) == 2
    assert "person 2: kept 20 of 100 frames" in lines[0]
    assert "21 to 100 (following, lost)" in lines[0]
    assert "person 3: never chosen in 96 frames" in lines[1]
