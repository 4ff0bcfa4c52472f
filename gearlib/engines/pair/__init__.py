"""One degree of freedom, linear damping, rectangular stiffness: closed forms between events.

=====================  ==================================================================
module                 responsibility
=====================  ==================================================================
``mesh_constants``     all constants of one mesh at one tuning
``damped_oscillator``  contact: closed form of the damped linear oscillator
``flight``             backlash: closed form of the free flight under load and oil drag
``crossing``           first crossing of a flank line, proven to be the first
``event_by_event``     from one event to the next through a segment of constant stiffness
``contact_table``      contact by a table over equal times, and when contact is lost
``whole_periods``      whole mesh periods without exp, sine or cosine
``settling``           when a run has settled, and where it then ends
``pair_run``           a whole run: fast until its last periods, which are recorded
``recorded_arcs``      what is recorded of a period, read off its arcs
``many_runs``          runs over many tunings, over many initial states
``sections``           states of many orbits at one mesh phase of every period
``deviation``          linearised maps of phases and flank crossings
``pair_maps``          growth of small deviations over mesh periods
``elementary``         exp, sine and cosine as plain arithmetic
=====================  ==================================================================
"""
