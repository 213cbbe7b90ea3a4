"""What four public trackers make of the same boxes.

Measured with the package `trackers` 2.6.1 (Roboflow): every tracker's defaults, told the frame rate
of the sequence; BoT-SORT without camera motion compensation, which needs pictures. Every frame from
the first; boxes, ground truth and scorer as in `benchmarks.association`. The package is no
dependency of Heel's, so the figures are kept here.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class BaselineScores:
    """Scores of one tracker on one sequence: percent, but `idsw` (count) and `ms` (a frame)."""

    sequence: str
    tracker: str
    mota: float
    idf1: float
    keep: float
    wrong: float
    idsw: int
    ms: float


_ROWS = """
PETS09-S2L1,SORT,57.1,40.2,20.7,3.8,99,0.23
TUD-Campus,SORT,56.3,55.3,42.8,2.9,8,0.24
PETS09-S3MF1,SORT,68.7,69.6,57.1,0.2,8,0.26
ADL-Rundle-8,SORT,24.4,33.0,11.9,5.4,150,0.37
ETH-Bahnhof,SORT,38.4,57.9,58.1,3.0,112,0.35
ETH-Pedcross2,SORT,43.7,57.9,33.6,10.0,102,0.29
KITTI-13,SORT,17.5,45.8,52.6,5.2,22,0.18
Venice-2,SORT,16.0,35.0,19.1,9.3,68,0.38
PETS09-S2L1 (true boxes),SORT,99.0,93.9,94.1,0.0,2,0.23
PETS09-S2L1,ByteTrack,58.6,45.4,27.1,11.5,79,0.25
TUD-Campus,ByteTrack,57.9,60.3,48.8,2.0,5,0.26
PETS09-S3MF1,ByteTrack,72.4,76.4,84.0,0.0,1,0.26
ADL-Rundle-8,ByteTrack,23.4,33.1,10.4,11.8,135,0.36
ETH-Bahnhof,ByteTrack,35.1,55.0,60.4,4.0,111,0.31
ETH-Pedcross2,ByteTrack,43.8,56.3,30.2,10.0,109,0.27
KITTI-13,ByteTrack,12.3,46.6,50.4,10.7,27,0.20
Venice-2,ByteTrack,15.9,36.8,22.3,5.5,57,0.40
PETS09-S2L1 (true boxes),ByteTrack,99.5,94.1,94.1,0.0,2,0.24
PETS09-S2L1,OC-SORT,56.2,45.9,25.3,6.7,68,0.41
TUD-Campus,OC-SORT,57.1,68.0,52.2,1.5,3,0.44
PETS09-S3MF1,OC-SORT,46.8,63.7,59.6,0.0,0,0.39
ADL-Rundle-8,OC-SORT,25.9,31.7,14.3,5.5,91,0.83
ETH-Bahnhof,OC-SORT,42.4,56.7,61.0,2.8,67,0.60
ETH-Pedcross2,OC-SORT,44.0,54.3,39.0,8.1,62,0.50
KITTI-13,OC-SORT,17.3,41.6,46.8,4.5,21,0.41
Venice-2,OC-SORT,19.1,40.3,28.4,16.0,47,0.70
PETS09-S2L1 (true boxes),OC-SORT,98.7,89.9,94.1,0.0,2,0.37
PETS09-S2L1,BoT-SORT,58.9,47.4,29.2,5.4,79,0.39
TUD-Campus,BoT-SORT,63.2,74.5,65.5,1.1,4,0.38
PETS09-S3MF1,BoT-SORT,75.5,86.1,93.7,0.0,0,0.36
ADL-Rundle-8,BoT-SORT,25.3,36.6,10.4,17.4,112,0.59
ETH-Bahnhof,BoT-SORT,39.2,56.7,67.6,3.9,79,0.49
ETH-Pedcross2,BoT-SORT,45.1,55.0,36.7,9.0,107,0.45
KITTI-13,BoT-SORT,12.1,44.6,46.5,8.0,33,0.54
Venice-2,BoT-SORT,17.3,40.3,30.5,14.0,56,0.68
PETS09-S2L1 (true boxes),BoT-SORT,99.6,94.1,94.1,0.0,2,0.40
"""


def _parse(row: str) -> BaselineScores:
    sequence, tracker, mota, idf1, keep, wrong, idsw, ms = row.split(",")
    scores = (float(mota), float(idf1), float(keep), float(wrong))
    return BaselineScores(sequence, tracker, *scores, int(idsw), float(ms))


BASELINES = tuple(_parse(row) for row in _ROWS.split("\n") if row)
