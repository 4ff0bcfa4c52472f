"""Solvers from packages of others behind ``method=``, none of them imported before it is used.

==================  =========  ===========================================================
module              package    responsibility
==================  =========  ===========================================================
``heyoka``          heyoka     Taylor steps of order 20 compiled per model structure
``heyoka_meshes``   heyoka     the integrator of piecewise-linear models, any meshes
``package``         --         whether a package is there, and what to install
==================  =========  ===========================================================

Besides what `gearlib.integrators` asks of a method, each offers ``PACKAGE``, a
`package.Package`.
"""
