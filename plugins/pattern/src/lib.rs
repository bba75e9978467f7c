//! Perturbations of the graphic pattern family: what lies on the glass or is drawn over the frame.

mod canny_edges_mapping;
mod cutout_filter;
mod dotted_lines_mapping;
mod logo;
mod object_overlay;
mod ray;
mod splatter_mapping;
mod zigzag_mapping;

#[cfg(test)]
#[path = "../../golden.rs"]
mod golden;

pdk_sdk::export! {
    perturbations: [
        canny_edges_mapping::CannyEdgesMapping,
        cutout_filter::CutoutFilter,
        dotted_lines_mapping::DottedLinesMapping,
        object_overlay::ObjectOverlay,
        splatter_mapping::SplatterMapping,
        zigzag_mapping::ZigzagMapping,
    ]
}
