"""Statistics, tables and the HTML page of a campaign.

report.py      `lifeline fault-report`: files in, a page out
figures.py     the numbers of each class (pure); statistics.py what they need (pure)
table.py       the results on the terminal
page.py        the page of HTML (pure); drawing.py its pictures (pure)
"""
