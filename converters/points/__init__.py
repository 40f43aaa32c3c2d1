"""Points: clouds and Gaussian splats as tables of named columns, in all their files.

In: a PointTable, or a file of one.
Out: the file with every column, remark and further element that its format keeps, or the table.
Read: table, ply, pcd, las, gaussians, splat_files, views.
"""
