!> Fields that vanish off a set of nodes, and serve as estimates: their values at these nodes, in single precision.
module hc_packed_fields
  use hc_precision, only: wp, sp
  use hc_field_space, only: field_space_t
  use hc_active_set, only: active_set_t
  implicit none
  private

  public :: packed_fields_t, new_packed_fields

  !> Fields on the nodes of a set.
  type :: packed_fields_t
    !> Number of fields
    integer :: n_field = 0
    type(field_space_t), private :: space
    !> The nodes, and the values there (n_active, number of fields)
    type(active_set_t), private :: nodes
    real(sp), allocatable, private :: values(:, :)
  contains
    !> Keep a field, and return it over all nodes
    procedure :: keep, restore
  end type packed_fields_t

contains

  !> Set up a number of fields.
  subroutine new_packed_fields(self, nodes, n_field, space)
    !> Fields to be set up
    type(packed_fields_t), intent(out) :: self
    !> Nodes that they do not vanish at
    type(active_set_t), intent(in) :: nodes
    !> Number of fields
    integer, intent(in) :: n_field
    !> Space of the fields
    type(field_space_t), intent(in) :: space

    self%n_field = n_field
    self%space = space
    self%nodes = nodes
    allocate (self%values(nodes%n_active, n_field))
  end subroutine new_packed_fields

  !> Keep a field.
  subroutine keep(self, k, field)
    class(packed_fields_t), intent(inout) :: self
    !> Its number
    integer, intent(in) :: k
    !> The field
    real(wp), intent(in), contiguous :: field(:)

    call self%nodes%pack(field, self%values(:, k))
  end subroutine keep

  !> Return a field that was kept.
  subroutine restore(self, k, field)
    class(packed_fields_t), intent(in) :: self
    !> Its number
    integer, intent(in) :: k
    !> The field
    real(wp), intent(out), contiguous :: field(:)

    call self%space%fill(field, 0.0_wp)
    call self%nodes%unpack(real(self%values(:, k), wp), field)
  end subroutine restore

end module hc_packed_fields
