"""Solvers from packages of others behind ``method=``, none of them imported before it is used.

====================  ==============  ========================================================
module                package         responsibility
====================  ==============  ========================================================
``heyoka``            heyoka          Taylor steps of order 20 compiled per model structure
``heyoka_meshes``     heyoka          the integrator of piecewise-linear models, any meshes
``cvode``             scikit-sundae   SUNDIALS CVODE with root functions
``diffrax``           diffrax         Dormand-Prince pairs in JAX, with events
``package``           --              whether a package is there, and what to install
``contact_branches``  --              one degree of freedom as a compiled right-hand side
====================  ==============  ========================================================

Besides what `gearlib.integrators` asks of a method, each offers ``PACKAGE``, a
`package.Package`.
"""
