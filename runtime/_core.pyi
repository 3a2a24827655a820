"""What Python sees of the extension module (core/run/module.c)."""

from typing import Any

from numpy.typing import NDArray

def address(array: NDArray[Any], /) -> int:
    """Address of an array's first element; the caller keeps the array alive."""

SD_BY_SUMS: float
SD_BY_FACTORS: float
SD_CANCELS: float
SD_DEPENDENT: float
SD_MET: float
SD_SAME: float
SD_INSTANT: float
SD_HALF_OF_ITS_DIGITS: float
SD_OPEN: float
SD_UNSEEN: float
SD_SLIGHT: float
SD_SMALL: float
SD_PIVOT: float
SD_GENERIC: float
SD_GRANTED: float
SD_EVALUATION: float
SD_EACH: float
FALLEN: float
ROUNDING: float
SD_CONTRACT: int
SD_NODES: int
SD_PAST: int
SD_MANY_COUNTERS: int
SD_MANY_ROWS: int
SD_ROW_HEAD: int
SD_TRACE: int
SD_SAMPLE: int
SD_COMPARED: int
SD_RELAXING: int
SD_PARTS: int
SD_JUMP: int
SD_BRANCH_SLIDES: int
SD_BRANCH_RESTS: int
SD_AUDIT_HEAD: int
SD_LEDGER_ROWS: int
SD_LARGEST: int
SD_CAPPED: int
SD_DIFFERS: int
SD_MISSED: int
SD_LEFT_OUT: int
SD_ITERATIONS: int
SD_HALVINGS: int
SD_LOST: int
SD_FOLDS: int
SD_MAX_ORDER: int
SD_ENERGY_STAGES: int
SD_DOPRI_ALL: int
SD_DOPRI_DENSE: int
SD_STAGES: int
SD_PAIRS: int
SD_POINTS: int
SD_UNPULLED: int
SD_ROSENBROCK_STAGES: int
SD_ROSENBROCK_DENSE: int
