"""The one door for files: what may be read, what may be written, and that it appears whole."""

from .inputs import (
    MODEL_BYTES,
    RUNS_BYTES,
    SIMULATION_BYTES,
    check_input,
    partition_keys,
    partition_name,
    read_whole,
    sha256_of,
)
from .kinds import (
    CERTIFICATE,
    FLEET,
    MODEL,
    PAGE,
    PDF,
    PICTURE,
    REPORT,
    RUNS,
    SENSOR,
    SIMULATION,
    Kind,
    declare_endings,
    kind_of_log,
    promised_format,
)
from .outputs import check_output, external_output, publish, written_atomically
from .samefile import same_file
from .workplace import remove_leftovers, restore

__all__ = [
    "CERTIFICATE",
    "FLEET",
    "MODEL",
    "MODEL_BYTES",
    "PAGE",
    "PDF",
    "PICTURE",
    "REPORT",
    "RUNS",
    "RUNS_BYTES",
    "SENSOR",
    "SIMULATION",
    "SIMULATION_BYTES",
    "Kind",
    "check_input",
    "check_output",
    "declare_endings",
    "external_output",
    "kind_of_log",
    "partition_keys",
    "partition_name",
    "promised_format",
    "publish",
    "read_whole",
    "remove_leftovers",
    "restore",
    "same_file",
    "sha256_of",
    "written_atomically",
]
