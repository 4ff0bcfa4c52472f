"""Methods put to the test on problems of gear meshes.

====================  =============================================================
module                responsibility
====================  =============================================================
``problems``          test problems, runs of any method, references that are no method's own
``work_precision``    ladders of accuracy knobs; errors against evaluations and time
``jump_by_method``    where each method puts the jump of the motion from rest
====================  =============================================================
"""
