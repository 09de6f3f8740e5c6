"""Two recorded runs, or a run and a log from elsewhere: how far they are apart.

Bands and tubes are those of a qualification. Imports qualification, recording and what is below.
"""
