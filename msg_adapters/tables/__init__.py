"""Tables of real machines (CSV, TSV, MAT, Parquet, NPZ, JSON) to records."""

from msg_adapters.tables.guess import guess_map
from msg_adapters.tables.import_map import ImportMap, load_map
from msg_adapters.tables.importing import Imported, import_record, import_records, summary

__all__ = ["ImportMap", "Imported", "guess_map", "import_record", "import_records", "load_map", "summary"]
