"""The HTML report: page, histograms, films."""
