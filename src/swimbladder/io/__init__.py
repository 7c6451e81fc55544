"""Files in and out: vehicles and missions (`config`, `presets`, `vehicle_file`), logs, results.

`files` writes whole files or none; `tables` writes CSV and CF netCDF files with it.
"""
