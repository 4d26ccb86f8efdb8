"""Results as files, all or nothing: written beside, synced, then named."""
