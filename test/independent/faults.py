"""Faults of recording, put into a finished record; each with the share of samples that it touches."""

import numpy as np

from rsea_ros.records.record import Channel, Record


def frozen_samples(record, rng, share=0.05):
    """Let the F/T sensor repeat its last value in runs of 5 to 40 samples."""
    channel = record["ft"]
    y, left = channel.y.copy(), round(share * len(channel))
    while left > 0:
        length = min(left, int(rng.integers(5, 41)))
        at = int(rng.integers(1, y.size - length))
        y[at : at + length] = y[at - 1]
        left -= length
    return record.with_channels(ft=Channel(channel.t.copy(), y))


def dropped_samples(record, rng, share=0.03):
    """Lose F/T samples, one by one."""
    channel = record["ft"]
    keep = rng.random(len(channel)) >= share
    return record.with_channels(ft=Channel(channel.t[keep], channel.y[keep]))


def duplicate_stamps(record, rng, share=0.02):
    """Give F/T samples the stamp of the one before."""
    channel = record["ft"]
    t = channel.t.copy()
    at = rng.choice(np.arange(1, t.size), round(share * t.size), replace=False)
    t[at] = channel.t[at - 1]
    return record.with_channels(ft=Channel(t, channel.y.copy()))


def clock_jump(record, rng, seconds=0.5):
    """Let the clock of the F/T sensor jump ahead somewhere in the middle, for good."""
    channel = record["ft"]
    t = channel.t.copy()
    t[int(t.size * rng.uniform(0.3, 0.7)) :] += seconds
    return record.with_channels(ft=Channel(t, channel.y.copy()))


def outliers(record, rng, share=0.01):
    """Throw F/T samples far off."""
    channel = record["ft"]
    y = channel.y.copy()
    at = rng.choice(y.size, round(share * y.size), replace=False)
    y[at] += rng.choice((-1.0, 1.0), at.size) * rng.uniform(40.0, 200.0, at.size)
    return record.with_channels(ft=Channel(channel.t.copy(), y))


def clipping(record, _rng, share=0.02):
    """Limit the range of the F/T sensor so that `share` of the samples lie beyond."""
    channel = record["ft"]
    limit = float(np.quantile(np.abs(channel.y), 1.0 - share))
    return record.with_channels(ft=Channel(channel.t.copy(), np.clip(channel.y, -limit, limit)))


def nan(record, rng, share=0.01):
    """Turn F/T samples into not-a-number."""
    channel = record["ft"]
    y = channel.y.copy()
    y[rng.choice(y.size, round(share * y.size), replace=False)] = np.nan
    return record.with_channels(ft=Channel(channel.t.copy(), y))


def missing_topic(record, _rng):
    """Leave out the F/T sensor."""
    kept = {name: channel for name, channel in record.channels.items() if name != "ft"}
    return Record(kept, record.source, record.epoch_ns)


_KINDS = (
    frozen_samples, dropped_samples, duplicate_stamps, clock_jump, outliers, clipping, nan, missing_topic
)  # fmt: skip
FAULTS = {fault.__name__: fault for fault in _KINDS}
