"""Top floor: loading, repair, tetrahedralisation, the pipeline, the report and the command line."""
