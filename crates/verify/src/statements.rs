//! Table of the lecture's statements and the hard cases of docs/numerics.md: for each the study scene that shows it,
//! the test that checks it, the page that explains it, and why some have no function.
//! [`document::verified`](super::document::verified) generates docs/verified.md from the table, and
//! crates/verify/tests/catalogue.rs checks it.

/// A statement of the lecture or a hard case.
#[derive(Debug, Clone, Copy)]
pub struct Statement {
    /// Id of docs/lecture.md, or N and a row of docs/numerics.md.
    pub id: &'static str,
    /// Study scene that shows the statement.
    pub scene: &'static str,
    /// Test that checks the statement, on pictures if possible.
    pub test: &'static str,
    /// Page under docs/ that explains the statement.
    pub page: &'static str,
    /// Equations of the statement.
    pub by: By,
}

/// Equations of a statement.
#[derive(Debug, Clone, Copy)]
pub enum By {
    /// The equations tagged with the id.
    Tags,
    /// These equations.
    Equations(&'static [&'static str]),
    /// No equation, for this reason.
    Nothing(&'static str),
}

const fn of(id: &'static str, scene: &'static str, test: &'static str, page: &'static str) -> Statement {
    Statement { id, scene, test, page, by: By::Tags }
}

const fn by(statement: Statement, by: By) -> Statement {
    Statement { by, ..statement }
}

const LECTURE: &str = "lecture.md";
const NUMERICS: &str = "numerics.md";
const COLOUR: &str = "colour.md";
const QUIZ: &str = "the_quiz_comes_out_of_the_shaders";
const BOUNDS: &str = "every_output_of_every_equation_is_within_its_bound";

/// Every id, in the order of the pages.
pub const STATEMENTS: &[Statement] = &[
    of("C1", "prism", "bands_and_colours_differ_from_spectra_as_the_tables_say", COLOUR),
    of("C2", "metamers", "bands_add_up_and_lines_are_not_missed", "decisions/spectra.md"),
    of("C3", "metamers", "a_picture_of_the_chart_has_the_differences_of_the_tables", "decisions/spectra.md"),
    of("C4", "etalon", "every_curve_shows_the_bytes_of_its_twin", LECTURE),
    by(
        of("R1", "radiance", "emitters_and_unlit_surfaces_show_their_radiance", LECTURE),
        By::Nothing("radiance along a ray is copied, not computed"),
    ),
    of("R2", "cornell", "lights_with_a_shape_light_as_their_form_factors_say", "decisions/paths.md"),
    of("R3", "lamps", "a_directional_light_gives_irradiance_times_albedo_over_pi_times_cosine", LECTURE),
    of("R4", "lamps", "a_point_light_falls_with_the_square_of_the_distance_and_ends_at_its_range", LECTURE),
    by(
        of("R5", "lamps", "an_opaque_object_casts_its_shadow_where_f64_has_it", "decisions/rays.md"),
        By::Nothing("visibility is an algorithm: the knob `shadows`"),
    ),
    by(
        of("R6", "cornell", "light_from_points_and_from_afar_is_what_the_local_model_says", "decisions/paths.md"),
        By::Nothing("the three models: the option --model"),
    ),
    by(
        of("R7", "prism", "wavelengths_do_not_mix", "decisions/spectra.md"),
        By::Nothing("wavelengths never mix: there is no function that could"),
    ),
    of("F1", "prism", "a_prism_bends_each_wavelength_as_sellmeier_and_snell_say", COLOUR),
    of("F2", "materials", "all_kinds_of_light_on_study_scenes_agree_with_the_formulas", NUMERICS),
    of("F3", "nested", "a_boundary_reflects_what_fresnels_equations_say", NUMERICS),
    of("F4", "nested", "mirrors_between_glass_vanish_in_a_white_furnace", "decisions/rays.md"),
    of("F5", "nested", "two_slabs_that_touch_shift_a_ray_as_both_do", "decisions/rays.md"),
    of("F6", "pool", "beyond_the_critical_angle_all_light_stays_inside", NUMERICS),
    by(
        of("F7", "pool", "snells_window_is_as_wide_as_the_critical_angle", LECTURE),
        By::Equations(&["fresnel_dielectric", "refract", "critical_angle"]),
    ),
    of("F8", "metals", "metals_have_the_reflectance_of_their_index", COLOUR),
    of("B1", "materials", "a_rough_metal_mirrors_a_card_as_the_integral_says", NUMERICS),
    of("B2", "materials", "all_kinds_of_light_on_study_scenes_agree_with_the_formulas", LECTURE),
    of("B3", "materials", "light_and_camera_may_be_exchanged", NUMERICS),
    of("B4", "lamps", "a_directional_light_gives_irradiance_times_albedo_over_pi_times_cosine", LECTURE),
    of("B5", "golden-bridge", "blinn_phong_is_off_by_the_ratio_of_the_cosines_when_they_are", NUMERICS),
    of("B6", "golden-bridge", "phong_coefficients_of_a_scene_give_b5_and_b6", NUMERICS),
    by(
        of("B7", "golden-bridge", "laboratory_forms_agree_with_the_functions_of_pictures", LECTURE),
        By::Equations(&["phong_lobe", "reciprocal_lobe", "ggx_distribution"]),
    ),
    by(
        of("B8", "metals", "metals_have_the_reflectance_of_their_index", LECTURE),
        By::Equations(&["schlick", "normal_reflectance", "diffuse_brdf"]),
    ),
    of("B9", "materials", "out_of_domain_values_are_the_documented_ones", LECTURE),
    of("A1", "absorber", "a_wedge_absorbs_by_the_length_of_each_path", "decisions/absorption.md"),
    of("A2", "haze", "errors_fall_by_the_order_of_the_rule", "decisions/absorption.md"),
    by(
        of("Q1", "nested", QUIZ, LECTURE),
        By::Equations(&["fresnel_schlick", "fresnel_dielectric", "fresnel_conductor"]),
    ),
    by(of("Q2", "lamps", QUIZ, LECTURE), By::Equations(&["lambert"])),
    by(of("Q3", "pool", QUIZ, LECTURE), By::Equations(&["critical_angle"])),
    by(of("Q4", "golden-bridge", QUIZ, LECTURE), By::Equations(&["blinn_phong", "reciprocal_phong"])),
    of("Q5", "materials", QUIZ, LECTURE),
    by(of("Q6", "lamps", QUIZ, LECTURE), By::Equations(&["light_point"])),
    of("N1", "materials", BOUNDS, NUMERICS),
    of("N2", "nested", "a_boundary_reflects_what_fresnels_equations_say", NUMERICS),
    of("N3", "nested", "reflected_and_transmitted_power_are_one", NUMERICS),
    of("N4", "pool", "reflectance_never_falls_on_the_way_to_the_critical_angle", NUMERICS),
    of("N5", "metals", BOUNDS, NUMERICS),
    of("N6", "metals", "the_textbook_form_is_worse_where_numerics_says_so", NUMERICS),
    of("N7", "metals", "reflected_and_transmitted_power_are_one", NUMERICS),
    of("N8", "metals", BOUNDS, NUMERICS),
    of("N9", "materials", "laboratory_forms_agree_with_the_functions_of_pictures", NUMERICS),
    of("N10", "etalon", "lookup_follows_the_convention", NUMERICS),
    of("N11", "pool", "refraction_obeys_snell_and_can_be_undone", NUMERICS),
    of("N12", "nested", "a_chain_of_reflections_keeps_its_length", NUMERICS),
    of("N13", "nested", "refraction_obeys_snell_and_can_be_undone", NUMERICS),
    of("N14", "torture", "powers_of_two_are_only_units", NUMERICS),
    of("N15", "materials", "laboratory_forms_agree_with_the_functions_of_pictures", NUMERICS),
    of("N16", "materials", "quantised_values_are_off_by_their_quantisation_error", "decisions/gbuffer.md"),
    of("N17", "golden-bridge", "laboratory_forms_agree_with_the_functions_of_pictures", NUMERICS),
    of("N18", "golden-bridge", "laboratory_forms_agree_with_the_functions_of_pictures", NUMERICS),
    of("N19", "golden-bridge", "no_tier_of_arithmetic_makes_nan_of_a_scene", NUMERICS),
    of("N20", "materials", "laboratory_forms_agree_with_the_functions_of_pictures", NUMERICS),
    of("N21", "materials", "a_rough_metal_mirrors_the_lobe_of_what_is_around", NUMERICS),
    of("N22", "materials", "the_roughest_metal_loses_in_a_furnace_what_the_integral_says", NUMERICS),
    of("N23", "materials", "laboratory_forms_agree_with_the_functions_of_pictures", NUMERICS),
    of("N24", "cornell", "squares_exchange_light_by_their_form_factor", "decisions/paths.md"),
    of("N25", "lamps", "laboratory_forms_agree_with_the_functions_of_pictures", NUMERICS),
    of("N26", "lamps", "lights_with_a_shape_light_as_their_form_factors_say", "decisions/paths.md"),
    of("N27", "absorber", "the_textbook_form_is_worse_where_numerics_says_so", NUMERICS),
    of("N28", "absorber", "a_wedge_absorbs_by_the_length_of_each_path", NUMERICS),
    of("N29", "absorber", "out_of_domain_values_are_the_documented_ones", NUMERICS),
    of("N30", "haze", "whole_numbers_keep_all_their_digits", NUMERICS),
    of("N31", "haze", "errors_fall_by_the_order_of_the_rule", "decisions/absorption.md"),
    of("N32", "lamps", "lights_of_the_lecture_agree_with_those_of_pictures", NUMERICS),
    of("N33", "etalon", "ten_kilometres_away_it_looks_the_same", NUMERICS),
    of("N34", "cornell", "lights_of_the_lecture_agree_with_those_of_pictures", NUMERICS),
    of("N35", "cornell", "lights_of_the_lecture_agree_with_those_of_pictures", NUMERICS),
    of("N36", "torture", "every_traversal_finds_what_brute_force_finds", "decisions/rays.md"),
    of("N37", "torture", "no_ray_passes_between_two_triangles_with_a_common_edge", "decisions/rays.md"),
    of("N38", "torture", "rays_neither_hit_their_own_surface_nor_leak", "decisions/rays.md"),
    of("N39", "torture", "a_ray_starts_on_the_right_side_of_its_surface", NUMERICS),
    of("N40", "torture", "a_sliver_of_large_coordinates_has_the_normal_of_exact_arithmetic", NUMERICS),
    of("N41", "etalon", "mirrored_and_stretched_placements_stay_outside_out", NUMERICS),
    of("N42", "etalon", "the_gbuffer_of_study_scenes_agrees_with_ray_casts", NUMERICS),
    by(
        of("N43", "blend", "any_opacity_is_good_to_a_half_float", "decisions/gbuffer.md"),
        By::Nothing("half floats store only texels and opacities of at most 1: no value is clamped"),
    ),
    of("N44", "etalon", "a_whole_render_shows_the_twin_s_bytes_over_its_background", NUMERICS),
    of("N45", "materials", "eight_bit_colours_survive_decoding_and_encoding", NUMERICS),
    of("N46", "prism", "a_prism_bends_each_wavelength_as_sellmeier_and_snell_say", NUMERICS),
    of("N47", "nested", "closed_meshes_of_equal_index_act_as_one", NUMERICS),
    of("N48", "metamers", "illuminants_have_their_chromaticities", COLOUR),
    of("N49", "cornell", "a_room_is_as_bright_as_its_walls_emit_and_keep", "decisions/paths.md"),
    of("N50", "prism", "white_is_white_in_every_model_and_number_of_bands", COLOUR),
];
