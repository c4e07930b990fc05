"""Engines of dynamic output feedback: what they search, how their controllers are chosen.

``engines`` calls them. Riccati: ``riccati_hinf`` (a ladder of regularised plants), with
``gamma_search`` and ``two_riccati``, and ``riccati_h2``. Matrix inequalities: ``lmi_engine``, with
``lmi_projected``, ``lmi_forms`` and ``reconstruction``. SLICOT: ``slycot_engine``. Before them
come ``diagnosis`` and ``solver_plant``; after them ``choice`` and ``simplification``.
"""
