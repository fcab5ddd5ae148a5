"""The paper's tables, and studies of p_hat and of another light, as rows on the engine.

May import: cfnav_core, studies.engine.
"""
