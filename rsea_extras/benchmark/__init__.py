"""The cause-naming benchmark: the format of its data sets, of the truth and of answers, and their scores."""
