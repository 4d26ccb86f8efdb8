"""What a page of results is made of."""

from rsea_ros.report import page as html, result_files, words
from rsea_ros.report.figures import figure as fig
from rsea_ros.report.page import Block, Html, bullets, fold, key_numbers, page, section
from rsea_ros.report.result_files import DIAGNOSIS_JSON, IDENTIFICATION_JSON, REPORT, strict

__all__ = [
    "DIAGNOSIS_JSON", "IDENTIFICATION_JSON", "REPORT", "Block", "Html", "bullets", "fig", "fold", "html",
    "key_numbers", "page", "result_files", "section", "strict", "words",
]  # fmt: skip
