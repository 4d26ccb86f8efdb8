"""Tables of real machines (CSV, TSV, MAT) to records."""

from msg_adapters.tables.import_map import ImportMap, load_map
from msg_adapters.tables.importing import import_record, summary

__all__ = ["ImportMap", "import_record", "load_map", "summary"]
