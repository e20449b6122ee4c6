use super::*;
use kort_thruster::effects::ALL;

fn of(id: &str) -> Usage {
    of_effect(kort_thruster::effects::find(id).unwrap())
}

#[test]
fn no_effect_is_passed_over_in_silence() {
    for effect in ALL {
        let usage = of_effect(effect);
        assert!(!usage.uses.is_empty() || usage.left.is_some(), "{usage:?}");
        assert!(usage.uses.is_empty() || !effect.nonparametric, "no rig can state it: {usage:?}");
    }
}

#[test]
fn effects_are_used_where_they_act() {
    for (id, used) in [
        ("coulomb_friction", Use::Friction),
        ("direction_dependent_friction", Use::Friction),
        ("viscous_friction", Use::Friction),
        ("windage_drag", Use::Friction),
        ("entrained_water_inertia", Use::Inertia),
        ("position_dependent_friction", Use::Angle),
        ("torque_ripple_cogging", Use::Angle),
        ("friction_warm_up", Use::Slow),
        ("gear_load_friction", Use::Torque),
        ("torque_constant_saturation", Use::Torque),
        ("thermal_drift_kt", Use::Slow),
        ("command_dead_band", Use::Command),
        ("command_curve", Use::Command),
        ("supply_sag", Use::Limits),
        ("supply_sag", Use::Command),
        ("voltage_limit_backemf", Use::Limits),
        ("current_saturation", Use::Limits),
        ("amplifier_lag", Use::Lag),
        ("transport_delay", Use::Delay),
        ("forward_reverse_asymmetry", Use::Blades),
        ("nonsinusoidal_lift_drag", Use::Blades),
        ("blade_stall", Use::Blades),
        ("rotational_flow", Use::Swirl),
        ("water_density", Use::Water),
        ("inertia_added_mass_error", Use::Water),
        ("duct_loss", Use::Stand),
        ("thrust_deduction_interaction", Use::Stand),
        ("ambient_axial_flow", Use::Ambient),
        ("thrust_bias_gain_hysteresis", Use::Sensors),
        ("thrust_sensor_lag", Use::Sensors),
        ("encoder_filter_lag", Use::Sensors),
        ("encoder_eccentricity", Use::Sensors),
        ("clock_skew", Use::Sensors),
        ("flowmeter_offset_lag_location", Use::Sensors),
        ("torque_channel_bias", Use::Sensors),
        ("axial_flow_dynamics", Use::Water),
        ("unsteady_lift_lag", Use::Building),
    ] {
        assert!(of(id).uses.contains(&used), "{id}: {:?}", of(id));
    }
    for id in ["ventilation", "cavitation", "gear_backlash"] {
        assert!(of(id).left.is_some(), "{:?}", of(id));
    }
}
