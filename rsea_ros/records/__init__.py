"""The record and what belongs to its time and samples: stamps, holds, gaps, spectra. All values SI."""
