"""Statistics, tables and the HTML page of a campaign.

report.py      `lifeline fault-report`: read the files, write the page
figures.py     the numbers of each class (pure); statistics.py quantiles and bounds (pure)
table.py       the results on the terminal, and as JSON
page.py        the HTML page (pure); drawing.py its pictures (pure)
"""
